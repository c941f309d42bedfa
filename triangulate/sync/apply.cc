#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "core/check.h"
#include "triangulate/sync/sync.h"

namespace mvstudio::triangulate {
namespace {

using People = std::vector<DetectedPerson>;
using CameraFrames = std::map<int, const People*>;

constexpr double kWhole = 1e-6;

/// Mean distance of the joints that both have, px; infinity without any.
double MeanDistance(const DetectedPerson& a, const DetectedPerson& b) {
  double sum = 0;
  int count = 0;
  for (size_t j = 0; j < std::min(a.size(), b.size()); ++j) {
    if (!(a[j].score > 0) || !(b[j].score > 0)) continue;
    sum += (a[j].px - b[j].px).norm(), ++count;
  }
  return count == 0 ? std::numeric_limits<double>::infinity() : sum / count;
}

const DetectedPerson* Nearest(const DetectedPerson& to, const People* people) {
  const DetectedPerson* best = nullptr;
  double best_distance = std::numeric_limits<double>::infinity();
  for (size_t p = 0; people && p < people->size(); ++p) {
    const double distance = MeanDistance(to, (*people)[p]);
    if (distance < best_distance) best_distance = distance, best = &(*people)[p];
  }
  return best;
}

bool Seen(const DetectedPerson* person, size_t j) { return person && j < person->size() && (*person)[j].score > 0; }

/// Cubic through the frames -1, 0, 1, 2 (Lagrange) at 0 < t < 1.
Eigen::Vector2d Cubic(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Eigen::Vector2d& c, const Eigen::Vector2d& d,
                      double t) {
  return -t * (t - 1) * (t - 2) / 6 * a + (t + 1) * (t - 1) * (t - 2) / 2 * b - (t + 1) * t * (t - 2) / 2 * c +
         (t + 1) * t * (t - 1) / 6 * d;
}

DetectedPerson Interpolate(const DetectedPerson* before, const DetectedPerson& a, const DetectedPerson& b,
                           const DetectedPerson* after, double t) {
  DetectedPerson person(a.size());
  for (size_t j = 0; j < a.size(); ++j) {
    if (!Seen(&a, j) || !Seen(&b, j)) continue;
    const bool four = Seen(before, j) && Seen(after, j);
    person[j].px = four ? Cubic((*before)[j].px, a[j].px, b[j].px, (*after)[j].px, t) : (1 - t) * a[j].px + t * b[j].px;
    person[j].score = std::min(a[j].score, b[j].score);
  }
  return person;
}

const People* At(const CameraFrames& frames, int frame) {
  const auto it = frames.find(frame);
  return it == frames.end() ? nullptr : it->second;
}

/// People at `first + t` who are in both frames and each other's nearest.
People Between(const CameraFrames& frames, int first, double t) {
  People between;
  const People *low = At(frames, first), *high = At(frames, first + 1);
  for (size_t p = 0; low && p < low->size(); ++p) {
    const DetectedPerson& a = (*low)[p];
    const DetectedPerson* b = Nearest(a, high);
    if (!b || Nearest(*b, low) != &a) continue;
    between.push_back(Interpolate(Nearest(a, At(frames, first - 1)), a, *b, Nearest(*b, At(frames, first + 2)), t));
  }
  return between;
}

void AddCamera(const CameraFrames& frames, size_t camera_idx, size_t num_cameras, double offset,
               std::map<int, DetectedFrame>* shifted) {
  const double whole = std::round(offset);
  const bool is_whole = std::abs(offset - whole) < kWhole;
  const int low = static_cast<int>(is_whole ? whole : std::floor(offset));
  for (const auto& [number, people] : frames) {
    if (!is_whole && frames.count(number + 1) == 0) continue;
    DetectedFrame& frame = (*shifted)[number - low];
    frame.frame = number - low;
    frame.people.resize(num_cameras);
    frame.people[camera_idx] = is_whole ? *people : Between(frames, number, offset - low);
  }
}

}  // namespace

std::vector<DetectedFrame> ApplyOffsets(const std::vector<DetectedFrame>& frames, const std::vector<double>& offset_frames) {
  std::map<int, DetectedFrame> shifted;
  for (size_t c = 0; c < offset_frames.size(); ++c) {
    if (std::isnan(offset_frames[c])) continue;
    MVS_CHECK(std::abs(offset_frames[c]) < 1e8, "offset of camera " << c << ": " << offset_frames[c] << " frames");
    CameraFrames of_camera;
    for (const DetectedFrame& frame : frames) {
      MVS_CHECK(frame.people.size() == offset_frames.size(),
                "frame " << frame.frame << ": " << frame.people.size() << " cameras");
      if (!frame.people[c].empty()) of_camera[frame.frame] = &frame.people[c];
    }
    AddCamera(of_camera, c, offset_frames.size(), offset_frames[c], &shifted);
  }
  std::vector<DetectedFrame> list;
  for (auto& [number, frame] : shifted) list.push_back(std::move(frame));
  return list;
}

}  // namespace mvstudio::triangulate
