"""Write assembly.step with OpenCASCADE's own exchange (cadquery-ocp-novtk 8.0), a program other than gmsh.

A block of 20 × 20 × 10 mm called "Soft Body", with a blind hole of radius 4 mm and depth 6 mm from the top and a closed
ball of radius 2 mm beside it; on top of it, placed by the assembly, a plate of 20 × 20 × 2 mm called "Stiff Plate" that
covers the hole except for an inlet of radius 1 mm; the file is in inches.

    pip install cadquery-ocp-novtk && python tests/geometry/data/make_assembly.py
"""

from pathlib import Path

from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeCylinder, BRepPrimAPI_MakeSphere
from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt, gp_Trsf, gp_Vec
from OCP.Interface import Interface_Static
from OCP.STEPCAFControl import STEPCAFControl_Writer
from OCP.TCollection import TCollection_ExtendedString
from OCP.TDataStd import TDataStd_Name
from OCP.TDocStd import TDocStd_Document
from OCP.TopLoc import TopLoc_Location
from OCP.XCAFDoc import XCAFDoc_DocumentTool

UP = gp_Dir(0, 0, 1)


def cut(shape, tool):
    return BRepAlgoAPI_Cut(shape, tool).Shape()


soft = BRepPrimAPI_MakeBox(gp_Pnt(-10, -10, 0), 20, 20, 10).Shape()
soft = cut(soft, BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(-4, 0, 4), UP), 4, 6).Shape())
soft = cut(soft, BRepPrimAPI_MakeSphere(gp_Pnt(5, 0, 5), 2).Shape())
plate = BRepPrimAPI_MakeBox(gp_Pnt(-10, -10, 0), 20, 20, 2).Shape()
plate = cut(plate, BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(-4, 0, 0), UP), 1, 2).Shape())

document = TDocStd_Document(TCollection_ExtendedString("XmlXCAF"))
tool = XCAFDoc_DocumentTool.ShapeTool_s(document.Main())
assembly = tool.NewShape()
TDataStd_Name.Set_s(assembly, TCollection_ExtendedString("gripper"))
lift = gp_Trsf()
lift.SetTranslation(gp_Vec(0, 0, 10))
for name, shape, place in (("Soft Body", soft, gp_Trsf()), ("Stiff Plate", plate, lift)):
    part = tool.AddShape(shape, False)
    TDataStd_Name.Set_s(part, TCollection_ExtendedString(name))
    component = tool.AddComponent(assembly, part, TopLoc_Location(place))
    TDataStd_Name.Set_s(component, TCollection_ExtendedString(name))
tool.UpdateAssemblies()

writer = STEPCAFControl_Writer()
Interface_Static.SetCVal_s("write.step.unit", "INCH")
writer.SetNameMode(True)
writer.Transfer(document)
writer.Write(str(Path(__file__).with_name("assembly.step")))
