"""The chaos monkey: breaks a running system, records what an outsider sees, and checks the promises on that.

observer → record → history → promises → report; faults and schedules are the monkey's. See `make chaos`.
"""
