"""What learners are made of beside tables and rules; each part has a command of its own."""
