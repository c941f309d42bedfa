#include "dataset/panoptic/exchanged.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "core/error.h"
#include "core/format.h"
#include "core/parallel.h"
#include "dataset/footage/image_io.h"
#include "geometry/lens/camera.h"

namespace mvstudio::dataset {
namespace {

using Poses = std::map<int, std::map<int, Coco19Pose>>;
constexpr int kMostFrames = 24, kLeastFrames = 5, kLeastJoints = 5;
constexpr int kSidePx = 320;              // to which images are reduced
constexpr double kMost = 8, kSteps = 31;  // of the mean change: what counts most, and its steps in a byte

/// What moves in the images of a camera, frame by frame; empty where there is no image, or nothing moves.
struct Motion {
  int width = 0, height = 0;    // of the images as they are stored
  std::vector<cv::Mat> change;  // CV_8U, kSteps times the mean
};

/// At most kMostFrames with people, spread evenly.
std::vector<int> FramesWithPeople(const Poses& poses) {
  std::vector<int> all, chosen;
  for (const auto& [frame, people] : poses) {
    if (!people.empty()) all.push_back(frame);
  }
  const size_t n = std::min<size_t>(kMostFrames, all.size());
  for (size_t i = 0; i < n; ++i) chosen.push_back(all[n == 1 ? 0 : i * (all.size() - 1) / (n - 1)]);
  return chosen;
}

cv::Mat ReducedGrey(const Image& image) {
  const Image small = Reduced(image, kSidePx);
  cv::Mat grey;
  cv::GaussianBlur(cv::Mat(small.height, small.width, CV_8UC1, const_cast<uint8_t*>(small.pixels.data())), grey, cv::Size(0, 0),
                   1.5);
  return grey;
}

cv::Mat MedianOf(const std::vector<cv::Mat>& images) {
  cv::Mat median;
  std::vector<uint8_t> values;
  for (const cv::Mat& image : images) {
    if (!image.empty() && median.empty()) median = cv::Mat(image.size(), CV_8UC1);
  }
  for (int i = 0; i < static_cast<int>(median.total()); ++i) {
    values.clear();
    for (const cv::Mat& image : images) {
      if (!image.empty()) values.push_back(image.data[i]);
    }
    std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2), values.end());
    median.data[i] = values[values.size() / 2];
  }
  return median;
}

Motion MotionOf(const std::string& camera, const std::vector<int>& frames,
                const std::function<std::string(const std::string&, int)>& path_of) {
  constexpr double kLeastChange = 0.3;  // grey levels
  Motion motion;
  for (const int frame : frames) {
    motion.change.emplace_back();
    const std::string path = path_of(camera, frame);
    std::error_code error;
    if (path.empty() || !std::filesystem::exists(path, error)) continue;
    try {
      const Image image = ReadImage(path, true);
      if (motion.width == 0) motion.width = image.width, motion.height = image.height;
      if (image.width == motion.width && image.height == motion.height) motion.change.back() = ReducedGrey(image);
    } catch (const FormatError&) {
      continue;
    }
  }
  const cv::Mat median = MedianOf(motion.change);
  for (cv::Mat& image : motion.change) {
    if (image.empty()) continue;
    cv::Mat change;
    cv::absdiff(image, median, change);
    const double mean = cv::mean(change)[0];
    image.release();
    if (mean >= kLeastChange) change.convertTo(image, CV_8U, kSteps / mean);
  }
  return motion;
}

/// Mean of a change at the joints as a camera sees them; nothing where it sees few, or has images of another size.
std::optional<double> AtJoints(const Motion& motion, size_t i, const std::map<int, Coco19Pose>& people,
                               const geometry::RigCamera& camera) {
  const cv::Mat& change = motion.change[i];
  if (change.empty() || camera.camera.width_px != motion.width || camera.camera.height_px != motion.height) return std::nullopt;
  const geometry::Projector projector(camera.camera);
  const double scale_x = static_cast<double>(change.cols) / motion.width,
               scale_y = static_cast<double>(change.rows) / motion.height;
  double sum = 0;
  int count = 0;
  for (const auto& [id, pose] : people) {
    for (int k = 0; k < 19; ++k) {
      if (!pose.valid[static_cast<size_t>(k)]) continue;
      const auto at = projector.Project(camera.cam_from_world * Eigen::Vector3d(pose.x_in_world.col(k)));
      if (at.status != Status::kOk || !InImage(camera.camera, at.px)) continue;
      const int x = std::clamp(static_cast<int>((at.px.x() + 0.5) * scale_x), 0, change.cols - 1);
      const int y = std::clamp(static_cast<int>((at.px.y() + 0.5) * scale_y), 0, change.rows - 1);
      sum += std::min(change.at<uint8_t>(y, x) / kSteps, kMost), ++count;
    }
  }
  if (count < kLeastJoints) return std::nullopt;
  return std::max(sum / count, 0.05);
}

/// [images][camera][frame]
using Fits = std::vector<std::vector<std::vector<std::optional<double>>>>;

struct PairGain {
  size_t a = 0, b = 0;
  int frames = 0, better = 0;
  double log_a = 0, log_b = 0, squared = 0;  // sums

  double Mean() const { return (log_a + log_b) / frames; }
  bool IsClear() const {
    const double least = std::log(1.05);
    if (frames < kLeastFrames || better < 0.8 * frames || log_a < least * frames || log_b < least * frames) return false;
    const double variance = std::max(0.0, squared / frames - Mean() * Mean()) * frames / (frames - 1);
    return Mean() >= std::log(1.25) && Mean() >= 4 * std::sqrt(std::max(variance, 4e-4) / frames);
  }
};

PairGain GainOf(const Fits& fits, size_t a, size_t b) {
  PairGain gain{a, b};
  for (size_t i = 0; i < fits[a][a].size(); ++i) {
    if (!fits[a][a][i] || !fits[a][b][i] || !fits[b][b][i] || !fits[b][a][i]) continue;
    const double of_a = std::log(*fits[a][b][i] / *fits[a][a][i]), of_b = std::log(*fits[b][a][i] / *fits[b][b][i]);
    ++gain.frames, gain.better += of_a + of_b > 0;
    gain.log_a += of_a, gain.log_b += of_b, gain.squared += (of_a + of_b) * (of_a + of_b);
  }
  return gain;
}

}  // namespace

std::string ExchangedCameras::Text(const std::string& name_a, const std::string& name_b) const {
  return Format(
      "the footage of %s and %s seems to be exchanged: what moves in their images lies %.1f and %.1f times as much on the "
      "joints as the other camera sees them (%d frames)",
      name_a.c_str(), name_b.c_str(), times_a, times_b, frames);
}

std::vector<ExchangedCameras> FindExchanged(const geometry::Rig& rig, const Poses& poses,
                                            const std::function<std::string(const std::string& camera, int frame)>& image,
                                            const RunContext& run) {
  const std::vector<int> frames = FramesWithPeople(poses);
  const size_t n = rig.cameras.size();
  if (n < 2 || frames.size() < kLeastFrames) return {};
  Fits fits(n, {n, std::vector<std::optional<double>>(frames.size())});
  ProgressStage stage(run, "images against joints", 1);
  ParallelFor(static_cast<int64_t>(n), run.num_threads, [&](int64_t f) {
    const auto of = static_cast<size_t>(f);
    const Motion motion = MotionOf(rig.cameras[of].camera.name, frames, image);
    for (size_t c = 0; c < n; ++c) {
      for (size_t i = 0; i < frames.size(); ++i) fits[of][c][i] = AtJoints(motion, i, poses.at(frames[i]), rig.cameras[c]);
    }
  });
  std::vector<PairGain> gains;
  for (size_t a = 0; a < n; ++a) {
    for (size_t b = a + 1; b < n; ++b) gains.push_back(GainOf(fits, a, b));
  }
  gains.erase(std::remove_if(gains.begin(), gains.end(), [](const PairGain& gain) { return !gain.IsClear(); }), gains.end());
  std::stable_sort(gains.begin(), gains.end(), [](const PairGain& a, const PairGain& b) { return a.Mean() > b.Mean(); });
  std::vector<ExchangedCameras> found;
  std::vector<bool> named(n, false);
  for (const PairGain& gain : gains) {
    if (named[gain.a] || named[gain.b]) continue;
    named[gain.a] = named[gain.b] = true;
    found.push_back({rig.cameras[gain.a].camera.name, rig.cameras[gain.b].camera.name, std::exp(gain.log_a / gain.frames),
                     std::exp(gain.log_b / gain.frames), gain.frames});
  }
  return found;
}

}  // namespace mvstudio::dataset
