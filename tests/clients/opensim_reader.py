#!/usr/bin/env python3
"""Checks marker sets and set-up files of OpenSim 4 against the properties of its classes, against the .trc and the model's bodies.

Usage: opensim_reader.py STEM [STEM ...]

Reads STEM.markers.xml, STEM.scale.xml, STEM.ik.xml and STEM.trc. OpenSim itself passes over elements that it does not know, so a
misspelt one would keep its default without a word. The properties are those that opensim-org/opensim-core declares:
OpenSim/Tools/{ScaleTool, GenericModelMaker, ModelScaler, MarkerPlacer, Measurement, MarkerPair, IKTask, IKMarkerTask,
IKCoordinateTask, InverseKinematicsToolBase, InverseKinematicsTool}.h, OpenSim/Simulation/Model/{BodyScale, Marker, Station, Point}.h and
OpenSim/Common/Set.h. The bodies are those of Models/RajagopalModel/Rajagopal2015.osim of opensim-org/opensim-models. Prints a
line a fault; exits 1 when there is one.
"""

import os
import sys
import xml.etree.ElementTree as xml

SIDED = ["femur", "tibia", "patella", "talus", "calcn", "toes", "humerus", "ulna", "radius", "hand"]
BODIES = {"pelvis", "torso"} | {name + side for name in SIDED for side in ("_r", "_l")}


def set_of(*classes):
    return {"objects": set(classes), "groups": {"ObjectGroup"}}


TASK = {"apply": "bool", "weight": "double"}
CLASSES = {
    "ScaleTool": {"mass": "double", "height": "double", "age": "double", "notes": "string", "GenericModelMaker": "object",
                  "ModelScaler": "object", "MarkerPlacer": "object"},
    "GenericModelMaker": {"model_file": "string", "marker_set_file": "string"},
    "ModelScaler": {"apply": "bool", "scaling_order": "words", "MeasurementSet": "object", "ScaleSet": "object",
                    "marker_file": "string", "time_range": "double 2", "preserve_mass_distribution": "bool",
                    "output_model_file": "string", "output_scale_file": "string", "print_result_files": "bool"},
    "MarkerPlacer": {"apply": "bool", "IKTaskSet": "object", "marker_file": "string", "coordinate_file": "string",
                     "time_range": "double 2", "output_motion_file": "string", "output_model_file": "string",
                     "output_marker_file": "string", "max_marker_movement": "double", "print_result_files": "bool",
                     "move_model_markers": "bool"},
    "MeasurementSet": set_of("Measurement"),
    "Measurement": {"apply": "bool", "MarkerPairSet": "object", "BodyScaleSet": "object"},
    "MarkerPairSet": set_of("MarkerPair"),
    "MarkerPair": {"markers": "words 2"},
    "BodyScaleSet": set_of("BodyScale"),
    "BodyScale": {"axes": "axes"},
    "ScaleSet": set_of("Scale"),
    "Scale": {"scales": "double 3", "segment": "string", "apply": "bool"},
    "IKTaskSet": set_of("IKMarkerTask", "IKCoordinateTask"),
    "IKMarkerTask": TASK,
    "IKCoordinateTask": {**TASK, "value_type": "string", "value": "double"},
    "InverseKinematicsTool": {"results_directory": "string", "model_file": "string", "constraint_weight": "double",
                              "accuracy": "double", "time_range": "double 2", "output_motion_file": "string",
                              "report_errors": "bool", "IKTaskSet": "object", "marker_file": "string",
                              "coordinate_file": "string", "report_marker_locations": "bool"},
    "MarkerSet": set_of("Marker"),
    "Marker": {"socket_parent_frame": "frame", "location": "double 3", "fixed": "bool"},
}
NAMED = {"Measurement", "BodyScale", "IKMarkerTask", "IKCoordinateTask", "Marker"}


def is_number(word):
    try:
        float(word)
        return True
    except ValueError:
        return False


def type_fault(kind, text):
    """What is wrong with a simple property's text, or ''."""
    name, _, count = kind.partition(" ")
    words = text.split()
    if count and len(words) != int(count):
        return "has %d values, not %s" % (len(words), count)
    if name == "bool" and text.strip() not in ("true", "false"):
        return "`%s` is no bool" % text.strip()
    if name == "double" and not (words and all(map(is_number, words)) and (count or len(words) == 1)):
        return "`%s` is no number" % text.strip()
    if name == "axes" and not (words and set(words) <= {"X", "Y", "Z"} and len(set(words)) == len(words)):
        return "`%s` are no axes" % text.strip()
    if name == "frame" and not (text.strip().startswith("/bodyset/") and text.strip()[9:] in BODIES):
        return "`%s` is no body of the model" % text.strip()
    if name in ("words", "string") and not words:
        return "is empty"
    return ""


class Document:
    def __init__(self, path, root_class, faults):
        self.path, self.faults = path, faults
        root = xml.parse(path).getroot()
        self.check(root.tag == "OpenSimDocument" and root.get("Version", "").isdigit() and int(root.get("Version")) >= 40000,
                   "root is %s %s" % (root.tag, root.attrib))
        self.check([child.tag for child in root] == [root_class], "holds %s" % [child.tag for child in root])
        self.tool = root[0]
        self.object(self.tool)

    def check(self, condition, text):
        if not condition:
            self.faults.append("%s: %s" % (os.path.basename(self.path), text))
        return condition

    def object(self, element):
        if not self.check(element.tag in CLASSES, "there is no class %s" % element.tag):
            return
        self.check(set(element.attrib) <= {"name"}, "%s has attributes %s" % (element.tag, element.attrib))
        self.check(element.tag not in NAMED or element.get("name"), "a %s without a name" % element.tag)
        seen = set()
        for child in element:
            where = "%s.%s" % (element.tag, child.tag)
            self.check(child.tag not in seen, where + " twice")
            seen.add(child.tag)
            kind = CLASSES[element.tag].get(child.tag)
            if self.check(kind is not None, where + " is no property"):
                self.value(where, kind, child)

    def value(self, where, kind, element):
        if isinstance(kind, set):  # the objects of a set
            for child in element:
                self.check(child.tag in kind, "%s holds a %s" % (where, child.tag))
                self.object(child)
        elif kind == "object":
            self.object(element)
        else:
            self.check(not len(element), where + " holds elements")
            fault = type_fault(kind, element.text or "")
            self.check(not fault, "%s %s" % (where, fault))

    def texts(self, tag):
        return [(element.text or "").strip() for element in self.tool.iter(tag)]

    def names(self, tag):
        return [element.get("name") for element in self.tool.iter(tag)]


def read_trc(path):
    lines = [line.rstrip("\n").split("\t") for line in open(path)]
    head = dict(zip(lines[1], lines[2]))
    return [name for name in lines[3][2:] if name], [float(line[1]) for line in lines[5:] if line[0]], head["Units"]


def check_person(stem, faults):
    folder = os.path.dirname(stem)
    markers = Document(stem + ".markers.xml", "MarkerSet", faults)
    scale = Document(stem + ".scale.xml", "ScaleTool", faults)
    ik = Document(stem + ".ik.xml", "InverseKinematicsTool", faults)
    columns, times, unit = read_trc(stem + ".trc")
    markers.check(unit in ("mm", "m"), "unit %s" % unit)
    placed = markers.names("Marker")
    markers.check(len(set(placed)) == len(placed), "a marker twice")
    markers.check(set(placed) <= set(columns), "not in the .trc: %s" % sorted(set(placed) - set(columns)))
    for document in (scale, ik):
        tasks = set(document.names("IKMarkerTask"))
        document.check(tasks == set(placed), "tasks and markers differ: %s" % sorted(tasks ^ set(placed)))
        for text in document.texts("time_range"):
            first, last = map(float, text.split())
            document.check(times[0] - 1e-6 <= first <= last <= times[-1] + 1e-6, "time_range %s, the .trc has %g to %g" %
                           (text, times[0], times[-1]))
        for name in document.texts("marker_file") + document.texts("marker_set_file"):
            document.check(os.path.isfile(os.path.join(folder, name)), name + " is not there")
    for pair in scale.texts("markers"):
        scale.check(set(pair.split()) <= set(placed), "`%s` are not both in the marker set" % pair)
    bodies = set(scale.names("BodyScale"))
    scale.check(bodies <= BODIES, "the model has no %s" % sorted(bodies - BODIES))
    scale.check(set(scale.texts("scaling_order")) <= {"measurements", "manualScale"}, "scaling_order")
    scale.check(set(scale.texts("output_model_file")) == set(ik.texts("model_file")), "scaling writes another model than ik reads")


def main():
    faults = []
    for stem in sys.argv[1:]:
        try:
            check_person(stem, faults)
        except xml.ParseError as error:
            faults.append("%s: %s" % (os.path.basename(stem), error))
    print("".join(fault + "\n" for fault in faults), end="")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
