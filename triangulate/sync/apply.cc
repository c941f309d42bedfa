#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <utility>

#include "core/check.h"
#include "triangulate/sync/sync.h"

namespace mvstudio::triangulate {
namespace {

using People = std::vector<DetectedPerson>;
using CameraFrames = std::map<int, const People*>;

constexpr double kWhole = 1e-6;
constexpr double kLeastRate = 1e-3;

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

/// People at a time between two frames of the camera, of one, or up to `beyond` frames outside of two; else nothing.
std::optional<People> At(const CameraFrames& frames, double position, double beyond) {
  const double whole = std::round(position);
  if (std::abs(position - whole) < kWhole) {
    const People* people = At(frames, static_cast<int>(whole));
    return people ? std::optional(*people) : std::nullopt;
  }
  const int low = static_cast<int>(std::floor(position));
  const double t = position - low;
  const bool has_low = At(frames, low), has_high = At(frames, low + 1);
  if (has_low && has_high) return Between(frames, low, t);
  if (has_high && 1 - t <= beyond && At(frames, low + 2)) return Between(frames, low + 1, t - 1);
  if (has_low && t <= beyond && At(frames, low - 1)) return Between(frames, low - 1, t + 1);
  return std::nullopt;
}

void AddCamera(const CameraFrames& frames, size_t camera_idx, size_t num_cameras, const Clock& clock, double beyond,
               std::map<int, DetectedFrame>* timed) {
  if (frames.empty()) return;
  const auto on_reference = [&](int frame) { return (frame - clock.offset_frames) / clock.rate; };
  const auto add = [&](int number) {
    std::optional<People> people = At(frames, clock.offset_frames + clock.rate * number, beyond);
    if (!people) return;
    DetectedFrame& frame = (*timed)[number];
    frame.frame = number;
    frame.people.resize(num_cameras);
    frame.people[camera_idx] = std::move(*people);
  };
  const double margin = std::max(kWhole, beyond / clock.rate);
  int next = static_cast<int>(std::ceil(on_reference(frames.begin()->first) - margin));
  for (const auto& [number, people] : frames) {  // the reference's frames up to the next of the camera's
    next = std::max(next, static_cast<int>(std::ceil(on_reference(number) - margin)));
    for (; next < on_reference(number + 1) - kWhole; ++next) add(next);
  }
}

}  // namespace

std::vector<DetectedFrame> ApplyClocks(const std::vector<DetectedFrame>& frames, const std::vector<Clock>& clocks,
                                       double beyond_frames) {
  std::map<int, DetectedFrame> timed;
  for (size_t c = 0; c < clocks.size(); ++c) {
    const Clock& clock = clocks[c];
    if (std::isnan(clock.offset_frames)) continue;
    MVS_CHECK(std::abs(clock.offset_frames) < 1e8, "offset of camera " << c << ": " << clock.offset_frames << " frames");
    MVS_CHECK(clock.rate >= kLeastRate && clock.rate <= 1 / kLeastRate, "rate of camera " << c << ": " << clock.rate);
    CameraFrames of_camera;
    for (const DetectedFrame& frame : frames) {
      MVS_CHECK(frame.people.size() == clocks.size(), "frame " << frame.frame << ": " << frame.people.size() << " cameras");
      if (!frame.people[c].empty()) of_camera[frame.frame] = &frame.people[c];
    }
    AddCamera(of_camera, c, clocks.size(), clock, beyond_frames, &timed);
  }
  std::vector<DetectedFrame> list;
  for (auto& [number, frame] : timed) list.push_back(std::move(frame));
  return list;
}

std::vector<DetectedFrame> ApplyOffsets(const std::vector<DetectedFrame>& frames, const std::vector<double>& offset_frames) {
  std::vector<Clock> clocks;
  for (const double offset : offset_frames) clocks.push_back({offset, 1});
  return ApplyClocks(frames, clocks);
}

}  // namespace mvstudio::triangulate
