#include "stages/triangulate/points_out.h"

#include <filesystem>

#include "core/disk/manifest.h"
#include "core/error.h"
#include "core/format.h"
#include "dataset/footage/frame_rate.h"
#include "dataset/pose/markers.h"
#include "dataset/pose/pose3d.h"

namespace mvstudio::stages {
namespace {

TruthComparison CompareWith(const ReferenceComparison& reference, const dataset::Pose3d& pose,
                            const TriangulateOptions& options) {
  const bool align = reference.option == "truth" && options.align_truth;
  return CompareWithTruth(pose, reference.path, {align, options.marker_unit});
}

}  // namespace

void CheckReferences(const TriangulateOptions& options) {
  if (!options.trc.empty()) dataset::ReadMarkers(options.trc, options.marker_unit);
  if (options.truth.empty()) return;
  if (!std::filesystem::exists(options.truth)) throw IoError(options.truth, "option 'truth' does not exist");
  const std::string found = dataset::PointsFileAt(options.truth);
  if (dataset::IsPointsFile(found) && std::filesystem::path(found).filename() != "points.csv")
    dataset::ReadMarkers(found, options.marker_unit);
}

std::vector<ReferenceComparison> CompareWithReferences(const TriangulateOptions& options) {
  std::vector<ReferenceComparison> comparisons;
  if (!options.trc.empty()) comparisons.push_back({"trc", options.trc});
  if (!options.truth.empty()) comparisons.push_back({"truth", options.truth});
  if (comparisons.empty()) return comparisons;
  const dataset::Pose3d pose = dataset::ReadPose3d(options.out);
  for (ReferenceComparison& comparison : comparisons) comparison.points = CompareWith(comparison, pose, options);
  return comparisons;
}

void FillMarkerOptions(const std::optional<FoundTake>& found, double footage_hz, const PoseChanges& changes,
                       MarkerOptions* options, InputNotes* notes) {
  const double session_hz = found ? found->take.fps_hz.value_or(found->session.fps_hz.value_or(0)) : 0;
  const double stated_hz = session_hz > 0 ? session_hz : footage_hz;
  const double changed_hz = StepRateHz(changes);
  if (options->rate_hz > 0 && stated_hz > 0 && changed_hz == 0 && !dataset::IsSameRate(options->rate_hz, stated_hz)) {
    notes->warnings.push_back({"MRK-RATE",
                               Format("the %s has %g frames a second; option 'frame-rate' %g is used",
                                      session_hz > 0 ? "session" : "footage", stated_hz, options->rate_hz),
                               "speeds and accelerations depend on it: leave option 'frame-rate' out to take the footage's"});
  }
  if (options->rate_hz == 0) options->rate_hz = changed_hz > 0 ? changed_hz : stated_hz;
  if (options->rate_hz != 0 && !dataset::IsFrameRate(options->rate_hz))
    throw UsageError(std::string("option 'frame-rate' ") + dataset::kFrameRates);
  if (options->to.empty()) {
    if (options->fill_frames != 0 || options->filter != "none" || options->opensim) {
      throw UsageError(
          "option 'filter', option 'fill' and option 'opensim' are for marker files: name them, e.g. option 'to' trc");
    }
    return;
  }
  CheckMarkerOptions(*options);
  if (options->rate_hz == 0)
    throw UsageError("option 'frame-rate': marker files state it; give that of the footage, e.g. option 'frame-rate' 60");
}

OldMarkers DropOldMarkers(const std::string& folder) {
  if (!ReadManifest(folder)) return OldMarkers::kNone;
  if (!FilesInTheWay(folder).empty()) return OldMarkers::kLeft;
  RemoveOurs({folder});
  return OldMarkers::kRemoved;
}

MarkerReport WriteMarkerFolder(const TriangulateOptions& options, const std::string& final_folder, AtomicFolder* folder,
                               std::vector<ReferenceComparison>* comparisons) {
  const dataset::Pose3d pose = dataset::ReadPose3d(options.out);
  const auto work = PrepareMarkers(pose, options.markers, options.out);
  MarkerReport report = WriteMarkers(work, pose, options.markers, folder->work_path(), final_folder);
  dataset::Pose3d written = PoseOf(work);
  written.skeleton = pose.skeleton, written.definition = pose.definition;
  const bool changed = options.markers.filter != "none" || options.markers.fill_frames > 0;
  for (ReferenceComparison& comparison : *comparisons) {
    if (changed) comparison.written = CompareWith(comparison, written, options);
  }
  folder->Commit();
  return report;
}

}  // namespace mvstudio::stages
