"""Operation push: the closed hand pushes what stands on the jig straight along a line."""

from planning.operations.operation import Operation
from planning.operations.push.measures import measure
from planning.operations.push.phases import carry_out

# It makes no joint and has no place in an assembly: experiments take steps of it on their own, and
# say themselves how far the jig should move.
PUSH = Operation(name="push", carry_out=carry_out, measure=measure)
