"""What an assembly is judged by, measured from true states and the log; nothing is assumed.

States and records that are measured from, one module per kind of operation, and the limits. Every
name carries its SI unit; a quantity that could not be measured, because the run stopped before, is
left out.
"""
