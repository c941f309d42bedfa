#pragma once

#include <string>
#include <vector>

#include "app/result.h"
#include "dataset/pose/pose3d.h"
#include "markers/fill.h"
#include "markers/filter.h"
#include "markers/marker_files.h"
#include "markers/marker_take.h"

/// 3D joints -> files of biomechanics programs, filled and filtered.
namespace mvstudio::app {

struct MarkerOptions {
  std::string to;  ///< words of trc, c3d, csv, bvh with commas between them; empty: nothing is written
  double rate_hz = 0;
  std::string filter = "none";  ///< markers::ParseFilter
  int fill_frames = 0;
  markers::TrcUnit trc_unit = markers::TrcUnit::kMillimetre;
  bool opensim = false;  ///< marker set, scaling and inverse kinematics beside each .trc
};

template <class Visitor>
void VisitFields(Visitor&& visit, MarkerOptions& o) {
  visit("to", o.to,
        "trc,c3d,csv,bvh: marker files that are written, one per person, with every joint; bvh has bones of one length");
  visit("frame-rate", o.rate_hz, "frames a second of the take; the session's unless given");
  visit("filter", o.filter,
        "butterworth:6Hz (fourth order, no delay), kalman (smoother that knows each point's sigma), gaussian:0.02s, median:5 "
        "(frames) or none");
  visit("fill", o.fill_frames, "gaps of at most so many frames are filled and marked; 0: none");
  visit("trc-unit", o.trc_unit, "mm or m: unit of the lengths in .trc files, which their headers state");
  visit("opensim", o.opensim, "write marker set, scaling and inverse kinematics for OpenSim 4 beside each .trc");
}

/// Throws UsageError where nothing is to be written, for unknown formats, filters, rates and lengths.
void CheckMarkerOptions(const MarkerOptions& options);

/// A person before and after.
struct MarkerWork {
  markers::MarkerTake before, after;
  markers::FillReport filled;
};

/// One of them, by the options' gaps and filter.
MarkerWork FilledAndFiltered(markers::MarkerTake take, const MarkerOptions& options);

/// Every person of the take. Throws FormatError when nobody has a position.
std::vector<MarkerWork> PrepareMarkers(const dataset::Pose3d& pose, const MarkerOptions& options, const std::string& path);

/// Positions after filling and filtering, all persons together: what the files hold.
dataset::Pose3d PoseOf(const std::vector<MarkerWork>& work);

/// Writes person<N>.trc, .c3d, .csv, .bvh, the files for OpenSim and markers.html into the folder. A skeleton without bones has
/// no hierarchy: then a warning says so, the other files are written, and the result is partial (exit 6). Adds the outputs, as
/// they will be called below `final_folder`, the metrics `markers` and a line of text. Says which joints OpenSim's files leave
/// out.
void WriteMarkers(const std::vector<MarkerWork>& work, const body::Skeleton& skeleton, const MarkerOptions& options,
                  const std::string& folder, const std::string& final_folder, CommandResult* result);

/// A warning "MRK-WORLD" where the joints' world (Pose3d::world) is that of a camera, and a file that says y up is written.
void CheckMarkerWorld(const std::string& world, const MarkerOptions& options, CommandResult* result);

/// Curves of every joint before and after, as a page; of long takes the middle.
std::string MarkerPage(const std::vector<MarkerWork>& work, const MarkerOptions& options);

}  // namespace mvstudio::app
