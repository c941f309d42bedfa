#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "core/disk/output.h"
#include "stages/input/session_input.h"
#include "stages/people/marker_export.h"
#include "stages/result.h"

/// What `triangulate` does with the points that it wrote: comparisons, and marker files beside them.
namespace mvstudio::cli {

struct ComparisonArguments {
  std::string trc, truth, marker_unit;
  bool align_truth = false;
};

/// Reads the references, so that a wrong path costs no run. Throws IoError, FormatError, UsageError.
void CheckComparison(const ComparisonArguments& arguments);

/// Compares the points in the folder `out` with the references: metrics `trc` and `truth`.
void AddComparisons(const ComparisonArguments& arguments, const std::string& out, stages::CommandResult* result);

/// A line that begins with its line break. `what` says which points were compared; empty where there are only these.
std::string ComparisonText(const std::string& key, const std::string& what, const nlohmann::ordered_json& comparison);

/// The take's rate, unless given: that of the changes, else the session's, else `footage_hz` (0: unknown); marker files need
/// one. Warns where the one given is not that of the session or footage. Throws UsageError.
void FillMarkerOptions(const std::optional<stages::FoundTake>& found, double footage_hz, const stages::PoseChanges& changes,
                       stages::MarkerOptions* options, stages::CommandResult* result);

struct MarkerFolderArguments {
  std::string points, folder;  ///< folders of the points and of the marker files
  stages::MarkerOptions options;
  ComparisonArguments comparison;
};

/// Fills `folder` with marker files and commits it. Where filling or a filter changes the points, they are compared as written
/// too: `written` in the metrics of each comparison. Nothing happens where there are no points.
void WriteMarkerFolder(const MarkerFolderArguments& arguments, AtomicFolder* folder, stages::CommandResult* result);

/// Marker files of points that were replaced must not pass for those of the new ones: removes the folder when mvstudio wrote
/// all of it, else warns "TRI-OLD-MARKERS".
void DropOldMarkers(const std::string& folder, stages::CommandResult* result);

}  // namespace mvstudio::cli
