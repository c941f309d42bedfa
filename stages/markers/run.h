#pragma once

#include <vector>

#include "stages/input_notes.h"
#include "stages/markers/options.h"

namespace mvstudio::stages {

struct MarkersReport {
  MarkersOptions options;  ///< with the frame rate of the points
  InputNotes notes;
  PointsInput input;
  MarkerReport written;
};

/// Writes markers, angles and OpenSim's files of people, filled and filtered. Throws UsageError, IoError and FormatError, as
/// the others here.
MarkersReport RunMarkers(MarkersOptions options);

struct MarkerEventsReport {
  MarkersOptions options;
  InputNotes notes;
  PointsInput input;
  std::vector<GaitOfPerson> persons;
};

/// Writes the gait events of people.
MarkerEventsReport RunMarkerEvents(MarkersOptions options);

struct MarkerConvertReport {
  MarkerConvertOptions options;
  InputNotes notes;
  PointsInput input;
  ConvertReport written;
};

/// Writes the points in another format.
MarkerConvertReport RunMarkerConvert(const MarkerConvertOptions& options);

}  // namespace mvstudio::stages
