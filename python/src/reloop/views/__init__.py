"""What the sim tells, as typed views over numpy arrays.

SI units, radians, the log's frame, heading counter-clockwise from +x, everywhere. Arrays are read-only.

| module | what |
| --- | --- |
| ``state`` | one box: the AV, a control |
| ``agents`` | the other road users at one step, as columns |
| ``signals`` | traffic lights at one step, as columns |
| ``line`` | the reference line, and its window around the AV |
| ``roads`` | the map: lanes, edges, lines, crosswalks, stop signs |
| ``history`` | what was seen before |
| ``scene`` | what is told before the first step |
| ``step`` | what is told at a step |
| ``taken`` | whom traffic drives, and where they go |
"""
