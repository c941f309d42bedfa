#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "dataset/exports/export.h"
#include "dataset/panoptic/panoptic.h"
#include "dataset/views/split.h"
#include "geometry/rig/rig.h"

/// The content of an export, determined before anything is written.
namespace mvstudio::exports {

using People = std::map<int, dataset::Coco19Pose>;

/// A camera as exported.
struct View {
  ExportedCamera info;
  geometry::RigCamera source;  ///< the lens of the dataset's images
  geometry::RigCamera camera;  ///< the lens of the exported ones
};

struct Take {
  std::string sequence;
  dataset::MaskFolder mask_folder;
  std::string root;  ///< the dataset's folder; empty for a rig alone
  std::vector<View> views;
  std::vector<int> frames;
  std::map<int, People> poses;
  std::optional<dataset::OwnJoints> own;  ///< the joints of another skeleton, where the dataset has them
  double frame_rate_hz = 30;
  std::optional<dataset::Split> split;

  const People& At(int frame) const;
  std::vector<int> PersonIds() const;
  /// Indices into views; all of them when there is no split and `part` is "train".
  std::vector<size_t> ViewsOf(dataset::PartOfSplit part) const;
};

/// Cameras, frames and lenses selected by the options; notes are added to the report. Throws UsageError.
Take PrepareTake(const dataset::PanopticDataset& dataset, const FormatInfo& format, const ExportOptions& options,
                 ExportReport* report);

/// A take without frames.
Take TakeOfRig(const geometry::Rig& rig, const FormatInfo& format, const std::string& path, ExportReport* report);

/// k1, k2, p1, p2, k3 of a pinhole or a Brown lens; empty for any other.
std::optional<Eigen::Matrix<double, 5, 1>> Brown5Of(const geometry::Camera& camera);
/// True when a lens of this kind describes `camera` exactly.
bool Carries(LensNeed need, const geometry::Camera& camera);

/// Names reduced to letters, digits, `_` and `-`, unique, at most 64 characters.
std::vector<std::string> SafeNames(const std::vector<std::string>& names);

/// Shortest text that parses to the same double.
std::string Num(double value);
/// `prefix` + at least `digits` digits + `suffix`.
std::string Numbered(const std::string& prefix, int number, int digits, const std::string& suffix);

/// Largest distance between the joints and the same rounded to float, metres: the loss in a single-precision format.
double FloatRoundingM(const Take& take);

}  // namespace mvstudio::exports
