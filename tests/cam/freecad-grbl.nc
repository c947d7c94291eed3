(Exported by FreeCAD)
(Post Processor: grbl_post)
(Output Time: 2026-01-05 10:00:00)
(Begin preamble)
G17 G90
G21
(Begin operation: Fixture)
(Path: Fixture)
G54
(Finish operation: Fixture)
(Begin operation: TC: Default Tool)
(Path: TC: Default Tool)
(TC: Default Tool)
(Begin toolchange)
M6 T1
M3 S8000
(Finish operation: TC: Default Tool)
(Begin operation: Profile)
(Path: Profile)
(Profile)
(Compensated Tool Path. Diameter: 3.0)
G0 Z5.000
G0 X-1.061 Y-1.061
G0 Z3.000
G1 X-1.061 Y-1.061 Z-1.000 F180.000
G3 X0.000 Y-1.500 Z-1.000 I1.061 J1.061 K0.000 F300.000
G1 X30.000 Y-1.500 Z-1.000 F300.000
G3 X31.500 Y0.000 Z-1.000 I0.000 J1.500 K0.000 F300.000
G1 X31.500 Y20.000 Z-1.000 F300.000
G0 Z5.000
(Finish operation: Profile)
(Begin postamble)
M5
G17 G90
M2
