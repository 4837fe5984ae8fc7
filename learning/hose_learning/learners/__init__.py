"""The learners: one file for each update rule, and the catalog of all of them."""
