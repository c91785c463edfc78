"""The chaos monkey: injects faults into a running arm, records it from outside, and checks the promises.

| module | content |
|---|---|
| `__main__` | `make chaos`: the command line, from the plan to the reports |
| `schedule` | when which fault is injected: named scenarios, random faults |
| `faults`, `inject/`, `babbler`, `clock`, `partition` | the kinds of faults |
| `testbed`, `arm` | the arms under test, and the injection |
| `observer`, `process_monitor`, `record` | the record: messages, processes, faults |
| `history` | the content of a record for one arm |
| `promises`, `safety`, `liveness`, `positions`, `findings` | the checkers of S1–S5 and L1–L4 |
| `report`, `page`, `pictures`, `cost` | the results |
"""
