"""What an assembly is judged by, measured from true states and the log; nothing is assumed.

Every name carries its SI unit. A quantity that could not be measured, because the run stopped
before, is left out.
"""
