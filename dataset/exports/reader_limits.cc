#include <algorithm>
#include <cmath>

#include "core/format.h"
#include "dataset/exports/writers.h"

/// What the programs that read an export cannot hold of a camera, though the format could: from their own source.
namespace mvstudio::exports {
namespace {

struct ReaderLimits {
  const char* format;
  const char* reader;  ///< "… takes it to be there"
  bool pinhole;        ///< it holds no distortion
  bool centred;        ///< it puts the principal point at the image's centre
  size_t most_cameras;
  const char* hint;
};

constexpr char kForSplatting[] = "for Gaussian splatting: option 'undistort' always, option 'undistort-view' centred";
constexpr char kForScenes[] =
    "option 'to' blender keeps the principal point; option 'undistort' always with option 'undistort-view' centred moves it";
constexpr size_t kAnyNumber = 1'000'000;

constexpr ReaderLimits kReaders[] = {
    {"colmap", "Gaussian splatting's loader", true, true, kAnyNumber, kForSplatting},
    {"gltf", "glTF, and so Blender's importer,", true, true, kAnyNumber, kForScenes},
    {"dynamic3dgs", "Dynamic 3D Gaussians' train.py", true, false, 50,
     "choose fewer with option 'cameras', or raise max_cams in it"},
};

void NoteCentres(const ReaderLimits& limits, const Job& job) {
  constexpr double kSmallPx = 0.1;
  int num_off = 0;
  double worst_px = 0;
  for (const View& view : job.take.views) {
    const geometry::Camera& lens = view.camera.camera;
    const double off_px = std::hypot(lens.cx() - (lens.width_px - 1) / 2.0, lens.cy() - (lens.height_px - 1) / 2.0);
    num_off += off_px > kSmallPx;
    worst_px = std::max(worst_px, off_px);
  }
  if (num_off == 0) return;
  job.report->notes.push_back(
      {"EXP-CENTRE",
       Format("%d cameras have their principal point off the image's centre, by %.1f px at most; %s takes it to be there",
              num_off, worst_px, limits.reader),
       limits.hint});
}

void NoteLenses(const ReaderLimits& limits, const Job& job) {
  size_t distorted = 0;
  for (const View& view : job.take.views) distorted += !Carries(LensNeed::kPinhole, view.camera.camera);
  if (distorted == 0) {
    if (limits.centred) NoteCentres(limits, job);
    return;
  }
  const bool refuses = limits.format == std::string("colmap");
  job.report->notes.push_back(
      {"EXP-LENS",
       std::to_string(distorted) + " cameras keep their distortion, which " +
           (refuses ? "COLMAP reads and Gaussian splatting's loader refuses" : std::string(limits.reader) + " leaves out"),
       limits.hint});
}

}  // namespace

void NoteReaderLimits(const Job& job) {
  for (const ReaderLimits& limits : kReaders) {
    if (job.report->format != limits.format) continue;
    if (limits.pinhole) NoteLenses(limits, job);
    if (job.take.views.size() > limits.most_cameras) {
      job.report->notes.push_back({"EXP-CAMERAS",
                                   std::to_string(job.take.views.size()) + " cameras; " + limits.reader + " has room for " +
                                       std::to_string(limits.most_cameras),
                                   limits.hint});
    }
  }
}

bool OpensEveryMask(const std::string& format) { return format == "zju" || format == "dynamic3dgs" || format == "actorshq"; }

}  // namespace mvstudio::exports
