#include "dataset/detect/joints/pose_overlay.h"

#include <cmath>
#include <opencv2/imgproc.hpp>

namespace mvstudio::detect {
namespace {

bool Drawable(const dataset::Keypoint2d& joint, double min_score) {
  constexpr double kFar = 1e5;  // OpenCV counts in fixed point
  return joint.score >= min_score && std::abs(joint.x_px) < kFar && std::abs(joint.y_px) < kFar;
}

}  // namespace

Image DrawPoses(const Image& rgb, const std::vector<dataset::Person2d>& people, const geometry::Skeleton& skeleton,
                double min_score) {
  constexpr int kShift = 4;  // bits behind the point in OpenCV's drawing
  Image drawn = rgb;
  cv::Mat canvas(drawn.height, drawn.width, CV_8UC3, drawn.pixels.data());
  const auto colours = geometry::BoneColours(skeleton);
  const int thickness = std::max(1, drawn.height / 400);
  const auto point = [](const dataset::Keypoint2d& joint) {
    return cv::Point(static_cast<int>(std::lround(joint.x_px * (1 << kShift))),
                     static_cast<int>(std::lround(joint.y_px * (1 << kShift))));
  };
  for (const dataset::Person2d& person : people) {
    for (size_t bone = 0; bone < skeleton.bones.size(); ++bone) {
      const auto& [a, b] = skeleton.bones[bone];
      const dataset::Keypoint2d &from = person.keypoints[static_cast<size_t>(a)],
                                &to = person.keypoints[static_cast<size_t>(b)];
      if (!Drawable(from, min_score) || !Drawable(to, min_score)) continue;
      const auto& rgb_of_bone = colours[bone];
      cv::line(canvas, point(from), point(to), cv::Scalar(rgb_of_bone[0], rgb_of_bone[1], rgb_of_bone[2]), thickness,
               cv::LINE_AA, kShift);
    }
  }
  return drawn;
}

}  // namespace mvstudio::detect
