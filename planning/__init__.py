"""What to do: feasibility, fixture analysis, orders, motion; it decides and never simulates."""

from planning.assembly_plan.plan_file import load_plan, save_plan
from planning.assembly_plan.planner import FixingPlan, plan
from planning.feasibility.algorithm import FixingStep, Stop

__all__ = ["FixingPlan", "FixingStep", "Stop", "load_plan", "plan", "save_plan"]
