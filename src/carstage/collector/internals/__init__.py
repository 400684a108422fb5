"""What the twelve modules of the paper rest on: the plan, matching, writing, events, stopping."""
