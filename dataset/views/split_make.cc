#include <algorithm>
#include <cmath>
#include <set>

#include "core/choice/frame_choice.h"
#include "core/error.h"
#include "core/join.h"
#include "core/random.h"
#include "core/statistics.h"
#include "dataset/views/crop.h"
#include "dataset/views/split.h"

namespace mvstudio::dataset {
namespace {

using Names = std::vector<std::string>;

Names AllCameras(const PanopticDataset& dataset) {
  Names names = geometry::CameraNames(dataset.rig);
  std::sort(names.begin(), names.end());
  return names;
}

Names Resolve(const PanopticDataset& dataset, const Names& given, const std::string& what) {
  Names names;
  for (const std::string& name : given) {
    const std::string resolved = dataset.Resolve(name);
    if (resolved.empty() || dataset.rig.Find(resolved) < 0) {
      throw UsageError(what + " camera '" + name + "' is not in the dataset " + dataset.root + "; it has " +
                       Join(AllCameras(dataset), ", "));
    }
    names.push_back(resolved);
  }
  std::sort(names.begin(), names.end());
  names.erase(std::unique(names.begin(), names.end()), names.end());
  return names;
}

template <class T>
std::vector<T> Without(const std::vector<T>& all, const std::vector<T>& taken) {
  std::vector<T> rest;
  std::copy_if(all.begin(), all.end(), std::back_inserter(rest),
               [&](const T& item) { return std::find(taken.begin(), taken.end(), item) == taken.end(); });
  return rest;
}

/// Median of the plausible joints of all people in all frames; the origin when there are none.
Eigen::Vector3d MiddleOfPeople(const PanopticDataset& dataset) {
  std::vector<double> coordinates[3];
  for (const auto& [frame, people] : dataset.poses) {
    for (const auto& [id, pose] : people) {
      const std::array<bool, 19> plausible = PlausibleJoints(pose);
      for (int j = 0; j < 19; ++j) {
        for (int k = 0; plausible[j] && k < 3; ++k) coordinates[k].push_back(pose.x_in_world(k, j));
      }
    }
  }
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (int k = 0; k < 3; ++k) middle[k] = UpperMedian(std::move(coordinates[k]), 0);
  return middle;
}

/// The options with the preset's own filled in.
SplitOptions WithPreset(const PanopticDataset& dataset, SplitOptions options) {
  if (options.preset.empty()) return options;
  if (!options.test_cameras.empty() || !options.train_cameras.empty() || options.num_train_cameras || options.every_camera) {
    throw UsageError("the preset " + options.preset + " chooses the cameras: leave out the other options that do");
  }
  const double cameras = static_cast<double>(dataset.rig.cameras.size());
  const auto share = [&](double of_31) { return std::max(1, static_cast<int>(std::lround(of_31 / 31 * cameras))); };
  if (options.preset == "tna-16") {
    options.num_train_cameras = share(16);
  } else if (options.preset == "tna-6") {
    options.num_train_cameras = share(6);
  } else if (options.preset == "person-a" || options.preset == "person-a-6" || options.preset == "person-a-3") {
    options.test_cameras = {"00_03", "00_08"};
    if (options.preset == "person-a-6") options.train_cameras = {"00_00", "00_01", "00_02", "00_04", "00_05", "00_06"};
    if (options.preset == "person-a-3") options.train_cameras = {"00_00", "00_02", "00_05"};
    if (options.test_frames.empty()) {
      for (int frame = 90; frame < 120; ++frame) options.test_frames.push_back(frame);
    }
  } else {
    throw UsageError("preset '" + options.preset + "' is not known; there are " +
                     Join(SplitPresets(), ", ", &SplitPreset::name));
  }
  return options;
}

/// train and test cameras; validation's are those named, or training's.
void ChooseCameras(const PanopticDataset& dataset, const SplitOptions& options, Split* split) {
  const Names all = AllCameras(dataset);
  const int ways = (options.num_train_cameras != 0) + (options.every_camera != 0) +
                   (!options.test_cameras.empty() || !options.train_cameras.empty());
  if (ways != 1) {
    throw UsageError(ways ? "choose the cameras one way: by name, by their number, or every k-th"
                          : "say which cameras are for test: by option 'preset', by name (option 'test-cameras' or option "
                            "'train-cameras'), by option 'train-count', or every k-th by option 'every-camera'");
  }
  const Names validation = Resolve(dataset, options.validation_cameras, "validation");
  Names train = Resolve(dataset, options.train_cameras, "training"), test = Resolve(dataset, options.test_cameras, "test");
  if (options.num_train_cameras) {
    if (options.num_train_cameras < 1 || options.num_train_cameras >= static_cast<int>(all.size())) {
      throw UsageError(std::to_string(options.num_train_cameras) + " training cameras of " + std::to_string(all.size()) +
                       ": one at least must be left for test");
    }
    for (const int c : SpreadCameras(dataset.rig, MiddleOfPeople(dataset), options.num_train_cameras, options.seed)) {
      train.push_back(dataset.rig.cameras[c].camera.name);
    }
  }
  if (options.every_camera) {
    if (options.every_camera < 2) throw UsageError("every-camera " + std::to_string(options.every_camera) + ": 2 at least");
    for (size_t i = options.every_camera - 1; i < all.size(); i += options.every_camera) test.push_back(all[i]);
  }
  if (train.empty()) train = Without(Without(all, test), validation);
  if (test.empty()) test = Without(Without(all, train), validation);
  std::sort(train.begin(), train.end());
  split->train.cameras = train, split->test.cameras = test;
  if (!options.validation_frames.empty()) split->validation.cameras = validation.empty() ? train : validation;
  if (options.validation_frames.empty() && !validation.empty()) {
    throw UsageError("validation cameras need validation frames: no frame may be in two parts");
  }
}

std::vector<int> Near(const std::vector<int>& frames, const std::vector<int>& others, int guard) {
  std::vector<int> near;
  for (const int frame : frames) {
    const auto after = std::lower_bound(others.begin(), others.end(), frame);
    const bool close = (after != others.end() && int64_t{*after} - frame <= guard) ||
                       (after != others.begin() && int64_t{frame} - *std::prev(after) <= guard);
    if (close) near.push_back(frame);
  }
  return near;
}

void ChooseFrames(const PanopticDataset& dataset, const SplitOptions& options, Split* split) {
  if (dataset.frames.empty()) throw UsageError("the dataset " + dataset.root + " has no frames");
  split->test.frames = KnownFrames("option 'test-frames'", options.test_frames, dataset.frames, dataset.root).frames;
  split->validation.frames =
      KnownFrames("option 'validation-frames'", options.validation_frames, dataset.frames, dataset.root).frames;
  if (split->test.frames.empty()) {
    if (!(options.test_share > 0 && options.test_share < 1)) {
      throw UsageError("test-share " + std::to_string(options.test_share) + ": more than 0 and less than 1");
    }
    const size_t n = dataset.frames.size(),
                 count = std::max<size_t>(1, std::llround(options.test_share * static_cast<double>(n)));
    split->test.frames.assign(dataset.frames.end() - static_cast<int64_t>(std::min(count, n)), dataset.frames.end());
  }
  if (options.guard_frames < 0) throw UsageError("guard " + std::to_string(options.guard_frames) + ": 0 at least");
  split->guard_frames = options.guard_frames;
  if (options.guard_frames > 0) {
    split->validation.frames =
        Without(split->validation.frames, Near(split->validation.frames, split->test.frames, options.guard_frames));
  }
  split->train.frames = Without(Without(dataset.frames, split->test.frames), split->validation.frames);
  for (const SplitPart* part : {&split->test, &split->validation}) {
    if (options.guard_frames == 0) break;
    split->train.frames = Without(split->train.frames, Near(split->train.frames, part->frames, options.guard_frames));
  }
  std::vector<int> unused = Without(Without(dataset.frames, split->train.frames), split->test.frames);
  split->unused_frames = Without(unused, split->validation.frames);
}

std::string RuleText(const SplitOptions& asked) {
  if (!asked.preset.empty()) return "preset " + asked.preset;
  if (asked.num_train_cameras) return std::to_string(asked.num_train_cameras) + " training cameras spread evenly";
  if (asked.every_camera) return "every camera number " + std::to_string(asked.every_camera) + " for test";
  return "cameras by name";
}

double Angle(const Eigen::Vector3d& a, const Eigen::Vector3d& b) { return std::atan2(a.cross(b).norm(), a.dot(b)); }

/// Smallest angle between two chosen cameras, then the mean of each one's smallest.
std::pair<double, double> Spread(const Eigen::MatrixXd& angles, const std::vector<int>& chosen) {
  double least = 10, sum = 0;
  for (const int a : chosen) {
    double nearest = 10;
    for (const int b : chosen) nearest = a == b ? nearest : std::min(nearest, angles(a, b));
    least = std::min(least, nearest), sum += nearest;
  }
  return {least, sum};
}

bool ExchangeOne(const Eigen::MatrixXd& angles, std::vector<int>* chosen) {
  const std::pair<double, double> before = Spread(angles, *chosen);
  for (int& member : *chosen) {
    const int old = member;
    for (int c = 0; c < angles.rows(); ++c) {
      if (std::find(chosen->begin(), chosen->end(), c) != chosen->end()) continue;
      member = c;
      const std::pair<double, double> after = Spread(angles, *chosen);
      const bool better =
          after.first > before.first + 1e-9 || (after.first > before.first - 1e-9 && after.second > before.second + 1e-9);
      if (better) return true;
      member = old;
    }
  }
  return false;
}

}  // namespace

const std::vector<SplitPreset>& SplitPresets() {
  static const std::vector<SplitPreset> presets{
      {"tna-16",
       "16 of 31 cameras for training, spread evenly (the same share of other rigs); the last quarter of the frames for test"},
      {"tna-6", "6 of 31 cameras for training, spread evenly; the last quarter of the frames for test"},
      {"person-a", "cameras 00_03 and 00_08 and frames 90 to 119 for test, the other cameras for training"},
      {"person-a-6", "the same test, trained on 00_00, 00_01, 00_02, 00_04, 00_05, 00_06"},
      {"person-a-3", "the same test, trained on 00_00, 00_02, 00_05"}};
  return presets;
}

std::vector<int> SpreadCameras(const geometry::Rig& rig, const Eigen::Vector3d& middle_in_world, int count, uint64_t seed) {
  constexpr int kMostForExchange = 64, kMaxExchanges = 1000;
  const int n = static_cast<int>(rig.cameras.size());
  Eigen::MatrixXd angles(n, n);
  for (int a = 0; a < n; ++a) {
    for (int b = 0; b < n; ++b) {
      angles(a, b) = Angle(rig.cameras[a].CenterInWorld() - middle_in_world, rig.cameras[b].CenterInWorld() - middle_in_world);
    }
  }
  std::vector<int> chosen;
  if (count <= 0 || n == 0) return chosen;
  Eigen::Index first = 0;
  angles.rowwise().sum().maxCoeff(&first);
  chosen.push_back(seed == 1 ? static_cast<int>(first) : static_cast<int>(Rng(seed).Index(n)));
  while (static_cast<int>(chosen.size()) < std::min(count, n)) {
    Eigen::VectorXd nearest = Eigen::VectorXd::Constant(n, 10);
    for (const int c : chosen) nearest = nearest.cwiseMin(angles.col(c));
    for (const int c : chosen) nearest[c] = -1;
    Eigen::Index next = 0;
    nearest.maxCoeff(&next);
    chosen.push_back(static_cast<int>(next));
  }
  for (int i = 0; i < kMaxExchanges && n <= kMostForExchange && ExchangeOne(angles, &chosen); ++i) {
  }
  std::sort(chosen.begin(), chosen.end());
  return chosen;
}

Split MakeSplit(const PanopticDataset& dataset, const SplitOptions& asked) {
  const SplitOptions options = WithPreset(dataset, asked);
  Split split;
  split.dataset = dataset.sequence;
  split.rule = RuleText(asked);
  ChooseCameras(dataset, options, &split);
  ChooseFrames(dataset, options, &split);
  split.blocks = FindMotionBlocks(dataset);
  const std::vector<std::string> faults = SplitFaults(split);
  if (!faults.empty()) throw UsageError("such a split would be wrong: " + Join(faults, ", "));
  return split;
}

}  // namespace mvstudio::dataset
