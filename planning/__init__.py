"""What to do: contact, interference, fixing, grasps, motion; it decides and never simulates."""

from planning.fixing.algorithm import FixingStep, Stop
from planning.plans.plan_file import load_plan, save_plan
from planning.plans.planner import FixingPlan, plan

__all__ = ["FixingPlan", "FixingStep", "Stop", "load_plan", "plan", "save_plan"]
