#pragma once

#include <string>

#include "dataset/pose/markers.h"

namespace mvstudio::dataset {

/// Reads the 3D points of a C3D file (Motion Lab Systems, "The C3D File Format: User Guide", 2008): points as 16-bit
/// integers or floats, in the byte order of Intel, DEC (VAX floats) or MIPS processors. Analog data are skipped. A negative
/// residual marks a missing point. Lengths are in POINT:UNITS. The axes are kept as z up, unless POINT:Y_SCREEN says that +Y
/// is up. Labels "SUBJECT:MARKER" of several subjects become persons, by order of appearance. The file counts frames from 1,
/// mvstudio from 0. A name that comes twice gets its number behind it. Frames that the file states and does not hold are left
/// out, those that it holds beyond a count that 16 bits end are read; both are notes. `unit`: as in ReadMarkers.
MarkerFile ReadC3dMarkers(const std::string& path, const std::string& unit = {});

}  // namespace mvstudio::dataset
