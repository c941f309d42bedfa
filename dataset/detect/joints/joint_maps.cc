#include "dataset/detect/joints/joint_maps.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "core/check.h"

namespace mvstudio::detect {

using dataset::Keypoint2d;

namespace {

struct Cell {
  int y = 0, x = 0;
};

/// One joint's share of the maps.
struct View {
  const JointMaps& maps;
  int joint = 0;

  size_t At(int y, int x) const { return (static_cast<size_t>(joint) * maps.height + y) * maps.width + x; }
  double Score(int y, int x) const { return maps.score[At(y, x)]; }
  double X(int y, int x) const {
    return maps.origin_x_px + x * maps.stride_px + (maps.dx_px.empty() ? 0 : maps.dx_px[At(y, x)]);
  }
  double Y(int y, int x) const {
    return maps.origin_y_px + y * maps.stride_px + (maps.dy_px.empty() ? 0 : maps.dy_px[At(y, x)]);
  }
  double Weighted(int y, int x) const {
    if (maps.prior_x_px.empty()) return Score(y, x);
    const auto j = static_cast<size_t>(joint);
    const double off = std::hypot(X(y, x) - maps.prior_x_px[j], Y(y, x) - maps.prior_y_px[j]);
    return Score(y, x) / (1 + std::pow(off / maps.prior_scale_px, maps.prior_power));
  }
};

Cell BestCell(const View& view) {
  Cell best;
  double highest = -1;
  for (int y = 0; y < view.maps.height; ++y) {
    for (int x = 0; x < view.maps.width; ++x) {
      const double score = view.Weighted(y, x);
      if (score > highest) highest = score, best = {y, x};
    }
  }
  return best;
}

/// The mean of the positions predicted by the best cell and its neighbours. A prediction far from the best cell's belongs
/// to another joint.
Keypoint2d MeanVote(const View& view, const Cell& best) {
  const JointMaps& maps = view.maps;
  const double x0 = view.X(best.y, best.x), y0 = view.Y(best.y, best.x);
  double sum = 0, sum_x = 0, sum_y = 0;
  for (int y = std::max(0, best.y - 2); y <= std::min(maps.height - 1, best.y + 2); ++y) {
    for (int x = std::max(0, best.x - 2); x <= std::min(maps.width - 1, best.x + 2); ++x) {
      const double vx = view.X(y, x), vy = view.Y(y, x);
      if (std::hypot(vx - x0, vy - y0) > 1.25 * maps.stride_px) continue;
      const double weight = std::pow(view.Score(y, x), 2);
      sum += weight, sum_x += weight * vx, sum_y += weight * vy;
    }
  }
  if (!(sum > 0)) return {x0, y0, 0};
  return {sum_x / sum, sum_y / sum, view.Score(best.y, best.x)};
}

/// Offset of the vertex of the parabola through three values at -1, 0, 1; at most half a cell.
double Vertex(double before, double middle, double after) {
  const double curvature = before - 2 * middle + after;
  if (!(curvature < 0)) return 0;
  return std::clamp(0.5 * (before - after) / curvature, -0.5, 0.5);
}

Keypoint2d PeakOf(const View& view, const Cell& best) {
  constexpr double kFloor = 1e-6;
  const JointMaps& maps = view.maps;
  const auto log_score = [&](int y, int x) { return std::log(std::max(kFloor, view.Score(y, x))); };
  const bool inside_x = best.x > 0 && best.x + 1 < maps.width, inside_y = best.y > 0 && best.y + 1 < maps.height;
  const double middle = log_score(best.y, best.x);
  const double fx = inside_x ? Vertex(log_score(best.y, best.x - 1), middle, log_score(best.y, best.x + 1)) : 0;
  const double fy = inside_y ? Vertex(log_score(best.y - 1, best.x), middle, log_score(best.y + 1, best.x)) : 0;
  return {maps.origin_x_px + (best.x + fx) * maps.stride_px, maps.origin_y_px + (best.y + fy) * maps.stride_px,
          view.Score(best.y, best.x)};
}

int MirrorOf(int joint, const std::vector<std::pair<int, int>>& mirror) {
  for (const auto& [a, b] : mirror) {
    if (joint == a) return b;
    if (joint == b) return a;
  }
  return joint;
}

}  // namespace

std::vector<Keypoint2d> ReadJoints(const JointMaps& maps) {
  MVS_CHECK(maps.score.size() == static_cast<size_t>(maps.joints) * maps.height * maps.width, "scores and sizes");
  std::vector<Keypoint2d> joints;
  for (int j = 0; j < maps.joints; ++j) {
    const View view{maps, j};
    const Cell best = BestCell(view);
    joints.push_back(maps.dx_px.empty() ? PeakOf(view, best) : MeanVote(view, best));
  }
  return joints;
}

JointMaps AverageMirrored(const JointMaps& maps, const JointMaps& mirrored, const std::vector<std::pair<int, int>>& mirror,
                          int crop_px) {
  // A cell x of the mirrored crop lies at crop_px - 1 - (origin + x stride) of the crop: shift cells there are a fraction of.
  JointMaps mean = maps;
  const double last = crop_px - 1 - 2 * maps.origin_x_px - (maps.width - 1) * maps.stride_px;  // px that the turned grid is off
  for (int j = 0; j < maps.joints; ++j) {
    const View here{maps, j}, there{mirrored, MirrorOf(j, mirror)};
    for (int y = 0; y < maps.height; ++y) {
      for (int x = 0; x < maps.width; ++x) {
        const size_t a = here.At(y, x), b = there.At(y, maps.width - 1 - x);
        const float p = maps.score[a], q = mirrored.score[b], sum = std::max(p + q, 1e-12f);
        mean.score[a] = 0.5f * (p + q);
        if (maps.dx_px.empty()) continue;
        mean.dx_px[a] = (p * maps.dx_px[a] + q * (static_cast<float>(last) - mirrored.dx_px[b])) / sum;
        mean.dy_px[a] = (p * maps.dy_px[a] + q * mirrored.dy_px[b]) / sum;
      }
    }
  }
  if (maps.prior_x_px.empty() || mirrored.prior_x_px.empty()) return mean;
  for (int j = 0; j < maps.joints; ++j) {
    const auto k = static_cast<size_t>(MirrorOf(j, mirror)), i = static_cast<size_t>(j);
    const float x = static_cast<float>(crop_px - 1) - mirrored.prior_x_px[k], y = mirrored.prior_y_px[k];
    if (std::hypot(x - maps.prior_x_px[i], y - maps.prior_y_px[i]) > maps.prior_scale_px) continue;  // another person
    mean.prior_x_px[i] = 0.5f * (maps.prior_x_px[i] + x);
    mean.prior_y_px[i] = 0.5f * (maps.prior_y_px[i] + y);
  }
  return mean;
}

Crop CropAround(const dataset::Person2d& pose, double fill, double min_score, double angle_rad) {
  const double c = std::cos(angle_rad), s = std::sin(angle_rad);
  double x0 = 1e300, x1 = -1e300, y0 = 1e300, y1 = -1e300;
  for (const Keypoint2d& joint : pose.keypoints) {
    if (joint.score < min_score) continue;
    const double x = c * joint.x_px + s * joint.y_px, y = -s * joint.x_px + c * joint.y_px;  // along the crop's axes
    x0 = std::min(x0, x), x1 = std::max(x1, x), y0 = std::min(y0, y), y1 = std::max(y1, y);
  }
  if (x1 < x0) return {};
  const double x = 0.5 * (x0 + x1), y = 0.5 * (y0 + y1);
  return {c * x - s * y, s * x + c * y, std::max({x1 - x0, y1 - y0, 8.0}) / fill, angle_rad};
}

double LeanOf(const dataset::Person2d& pose, const geometry::Skeleton& skeleton, double min_score) {
  if (pose.keypoints.size() != skeleton.joints.size()) return 0;
  double x = 0, y = 0;
  for (const char* side : {"L", "R"}) {
    const int hip = skeleton.Find(std::string(side) + "Hip"), shoulder = skeleton.Find(std::string(side) + "Shoulder");
    if (hip < 0 || shoulder < 0) return 0;
    const Keypoint2d &h = pose.keypoints[static_cast<size_t>(hip)], &s = pose.keypoints[static_cast<size_t>(shoulder)];
    if (h.score < min_score || s.score < min_score) return 0;
    x += s.x_px - h.x_px, y += s.y_px - h.y_px;
  }
  return std::atan2(x, -y);
}

dataset::Person2d OnSkeleton(const dataset::Person2d& pose, const geometry::Skeleton& from, const geometry::Skeleton& to) {
  dataset::Person2d person;
  for (const std::string& joint : to.joints) {
    const int at = from.Find(joint);
    person.keypoints.push_back(at < 0 ? Keypoint2d() : pose.keypoints[static_cast<size_t>(at)]);
  }
  return person;
}

Image CutCrop(const Image& rgb, const Crop& crop, int size) {
  MVS_CHECK(rgb.channels == 3 && crop.size_px > 0 && size > 0, "crop of " << crop.size_px << " px");
  const int samples = std::clamp(static_cast<int>(std::ceil(crop.size_px / size)), 1, 8);
  const double step = crop.size_px / (size * samples);  // image px a sample
  const cv::Mat source(rgb.height, rgb.width, CV_8UC3, const_cast<uint8_t*>(rgb.pixels.data()));
  const double c = step * std::cos(crop.angle_rad), s = step * std::sin(crop.angle_rad);
  const double first = -0.5 * (size * samples - 1);  // samples from the middle
  const cv::Matx23d source_from_sample(c, -s, crop.x_px + (c - s) * first, s, c, crop.y_px + (s + c) * first);
  cv::Mat sampled;
  cv::warpAffine(source, sampled, source_from_sample, {size * samples, size * samples}, cv::INTER_LINEAR | cv::WARP_INVERSE_MAP,
                 cv::BORDER_CONSTANT, cv::Scalar::all(127));
  Image image(size, size, 3);
  cv::Mat target(size, size, CV_8UC3, image.pixels.data());
  cv::resize(sampled, target, target.size(), 0, 0, cv::INTER_AREA);
  return image;
}

Image MirrorImage(const Image& rgb) {
  Image mirrored = rgb;
  for (int y = 0; y < rgb.height; ++y) {
    for (int x = 0; x < rgb.width; ++x) std::copy_n(rgb.Pixel(x, y), rgb.channels, mirrored.Pixel(rgb.width - 1 - x, y));
  }
  return mirrored;
}

Keypoint2d ToCrop(const Keypoint2d& in_image, const Crop& crop, int size) {
  const double scale = size / crop.size_px, middle = 0.5 * (size - 1);
  const double x = in_image.x_px - crop.x_px, y = in_image.y_px - crop.y_px;
  const double c = std::cos(crop.angle_rad), s = std::sin(crop.angle_rad);
  return {middle + scale * (c * x + s * y), middle + scale * (c * y - s * x), in_image.score};
}

Keypoint2d FromCrop(const Keypoint2d& in_crop, const Crop& crop, int size) {
  const double scale = crop.size_px / size, middle = 0.5 * (size - 1);
  const double x = scale * (in_crop.x_px - middle), y = scale * (in_crop.y_px - middle);
  const double c = std::cos(crop.angle_rad), s = std::sin(crop.angle_rad);
  return {crop.x_px + c * x - s * y, crop.y_px + s * x + c * y, in_crop.score};
}

}  // namespace mvstudio::detect
