#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/disk/output.h"
#include "stages/input/session_input.h"
#include "stages/people/marker_export.h"
#include "stages/people/pose_truth.h"
#include "stages/triangulate/options.h"

/// What is done with the points that were written: comparisons, and marker files beside them.
namespace mvstudio::stages {

/// The points beside a reference.
struct ReferenceComparison {
  std::string option, path;  ///< "trc" or "truth", and the reference
  TruthComparison points = {};
  std::optional<TruthComparison> written = {};  ///< as the marker files hold them, where filling or a filter changed them
};

/// Reads the references, so that a wrong path costs no run. Throws IoError, FormatError, UsageError.
void CheckReferences(const TriangulateOptions& options);

/// Compares the points in the folder option 'out' with the references.
std::vector<ReferenceComparison> CompareWithReferences(const TriangulateOptions& options);

/// The take's rate, unless given: that of the changes, else the session's, else `footage_hz` (0: unknown); marker files need
/// one. Warns where the one given is not that of the session or footage. Throws UsageError.
void FillMarkerOptions(const std::optional<FoundTake>& found, double footage_hz, const PoseChanges& changes,
                       MarkerOptions* options, InputNotes* notes);

/// Fills `folder`, to be called `final_folder`, with marker files of the points in the folder option 'out' and commits it.
/// Compares the points as written, too.
MarkerReport WriteMarkerFolder(const TriangulateOptions& options, const std::string& final_folder, AtomicFolder* folder,
                               std::vector<ReferenceComparison>* comparisons);

/// Marker files of points that were replaced must not pass for those of the new ones: removes the folder when mvstudio wrote
/// all of it.
enum class OldMarkers { kNone, kRemoved, kLeft };
OldMarkers DropOldMarkers(const std::string& folder);

}  // namespace mvstudio::stages
