#include "stages/pipeline/need.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "core/error.h"
#include "dataset/footage/frames.h"
#include "dataset/masks/masks.h"

namespace mvstudio::stages {
namespace {

using dataset::SessionTake;

constexpr double kRgbMb = 3e6 / (1 << 20);  // of a megapixel

/// MiB: a fixed part, for each camera, for each megapixel of one image, and for each megapixel of all images. Of more than
/// `most_frames` of a camera none is held at once.
struct NeedTerms {
  double fixed = NAN, per_camera = 0, per_megapixel = 0, per_image_megapixel = 0;
  int64_t most_frames = std::numeric_limits<int64_t>::max();

  double At(const FootageSize& size) const {
    const double images = size.cameras * static_cast<double>(std::min(size.num_frames, most_frames));
    return fixed + per_camera * size.cameras + size.megapixels * (per_megapixel + per_image_megapixel * images);
  }
};

struct NeedFormula {
  NeedTerms memory, disk;
};

constexpr int64_t kFramesOfChecks = 600;  // triangulate::kMostClockFrames

/// Seconds of one thread, without the start of the program: a fixed part, for each camera, for each megapixel of each camera,
/// for each image, for each megapixel of all images, for each image of the frames that checks look at, and for each pair of
/// cameras.
struct TimeTerms {
  double fixed = NAN, per_camera = 0, per_camera_megapixel = 0, per_image = 0, per_image_megapixel = 0, per_checked_image = 0,
         per_pair = 0;

  double At(const FootageSize& size) const {
    const double images = size.cameras * static_cast<double>(size.num_frames);
    const double checked = size.cameras * static_cast<double>(std::min(size.num_frames, kFramesOfChecks));
    return fixed + size.cameras * (per_camera + size.megapixels * per_camera_megapixel + size.cameras * per_pair) +
           images * (per_image + size.megapixels * per_image_megapixel) + checked * per_checked_image;
  }
};

/// Measured with one thread: docs/how-to-run-on-a-cluster.md, "Seconds".
TimeTerms TimeTermsOf(StageKind kind) {
  switch (kind) {
    case StageKind::kCalibrate:
      return {0.4, 0, 0, 0.0085, 0.072, 0, 0.0105};
    case StageKind::kPose2d:
      return {0.5, 0, 0, 0.41};
    case StageKind::kSync:
    case StageKind::kTriangulate:
      return {0.03, 0.02, 0, 0.0001, 0, 0.0007};
    case StageKind::kMask:
      return {0.3, 1.5, 6.6, 0.025, 0.15};
    case StageKind::kDataset:
      return {0.05, 0, 0, 0.0005, 0.045};
    case StageKind::kVerify:
      return {0, 0, 0, 0.0002, 0.057};
    case StageKind::kPack:
      return {0.02, 0, 0, 0.0017, 0.025};
    case StageKind::kSplit:
    case StageKind::kReport:
      return {0.1};
    default:  // trainings take what their steps take
      return {};
  }
}

/// Measured peaks of resident memory: docs/how-to-run-on-a-cluster.md, "Memory and disk".
NeedFormula FormulaOf(StageKind kind) {
  switch (kind) {
    case StageKind::kCalibrate:
      return {{216, 5, 100}, {0, 0.08}};
    case StageKind::kSync:
      return {{200}, {0.02}};
    case StageKind::kTriangulate:
      return {{213, 0, 20}, {0.2}};
    case StageKind::kMask:
      return {{500, 0, 350, kRgbMb, dataset::MaskOptions().background_frames}, {0, 1.1, 0, 0.005}};
    case StageKind::kDataset:
      return {{211, 0, 160}, {0.5, 0, 0, 0.17}};
    case StageKind::kVerify:
      return {{200, 0, 14}, {0.01}};
    case StageKind::kSplit:
      return {{190}, {0.01}};
    case StageKind::kAvatar:
      return {{590}, {53}};
    case StageKind::kEval:
      return {{580}, {}};
    case StageKind::kReport:
      return {{210}, {}};
    default:
      return {};
  }
}

/// No cameras: not known. The stage itself says what is wrong with its footage.
FootageSize SizeOfTake(const dataset::Session& session, const SessionTake& take, bool allow_outside) {
  FootageSize size;
  try {
    for (const dataset::SessionFootage& footage : take.footage) {
      const dataset::FootageInfo info =
          dataset::DescribeFootage(dataset::ResolveInSession(session, footage.path, allow_outside));
      if (info.num_frames == 0) return {};
      ++size.cameras;
      size.megapixels = std::max(size.megapixels, 1e-6 * info.width * info.height);
      size.num_frames = std::max(size.num_frames, info.num_frames);
    }
  } catch (const Error&) {
    return {};
  }
  return size;
}

}  // namespace

StageNeed NeedOf(StageKind kind, const FootageSize& size) {
  const NeedFormula formula = FormulaOf(kind);
  return {formula.memory.At(size), formula.disk.At(size), TimeTermsOf(kind).At(size)};
}

double ImageSeconds(StageKind kind, double megapixels) {
  const TimeTerms terms = TimeTermsOf(kind);
  return terms.per_image + megapixels * terms.per_image_megapixel;
}

void PredictNeeds(const dataset::Session& session, const PipelineOptions& options, std::vector<PipelineStage>* stages) {
  std::map<std::string, FootageSize> sizes;
  for (const SessionTake& take : session.takes) sizes[take.name] = SizeOfTake(session, take, options.allow_outside);
  const auto board = std::find_if(session.takes.begin(), session.takes.end(),
                                  [](const SessionTake& take) { return take.kind == dataset::TakeKind::kBoard; });
  for (PipelineStage& stage : *stages) {
    if (!stage.left_out.empty()) continue;
    const std::string take = stage.take.empty() && board != session.takes.end() ? board->name : stage.take;
    const FootageSize& size = sizes[take];
    if (size.cameras > 0 || stage.kind == StageKind::kReport) stage.need = NeedOf(stage.kind, size);
  }
}

}  // namespace mvstudio::stages
