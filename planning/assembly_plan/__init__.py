"""The plan as a value: Algorithm 1's steps with orders and evidence; its file and its text."""
