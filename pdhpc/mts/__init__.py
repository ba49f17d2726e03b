"""L3: the multi-time-step method: regions that step at their own dt, coupled by Lagrange multipliers on their overlap (Lindsay, Parks & Prakash 2016)."""
