"""Markov decision processes written out, and what the thesis proves of them."""
