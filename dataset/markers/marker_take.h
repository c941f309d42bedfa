#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "dataset/pose/pose3d.h"

/// Joints of one person as markers in time: what biomechanics programs read.
namespace mvstudio::markers {

/// Where a position comes from.
enum class Source : uint8_t {
  kMissing,
  kMeasured,  ///< triangulated from detections
  kFilled,    ///< predicted from other time steps
};

struct MarkerTake {
  int person = 0;
  double rate_hz = 0;
  int first_frame = 0;                      ///< of the take; frames follow each other without gaps
  std::vector<std::string> names;           ///< one per marker
  std::vector<Eigen::Vector3d> x_in_world;  ///< metres, frame by frame, marker by marker; NaN where missing
  std::vector<double> sigma_m;              ///< per position; 0 where unknown
  std::vector<Source> source;

  int num_markers() const { return static_cast<int>(names.size()); }
  int num_frames() const { return names.empty() ? 0 : static_cast<int>(source.size() / names.size()); }
  size_t Index(int frame_idx, int marker) const {
    return static_cast<size_t>(frame_idx) * names.size() + static_cast<size_t>(marker);
  }
};

/// One take per person, with every joint that has a position in some frame, in the order of the table. A joint without views
/// counts as filled. Frames that the table lacks are there, without positions. Throws UsageError for a rate that is not
/// positive, and for gaps that would make up most of a take of over a million frames.
std::vector<MarkerTake> MarkersOf(const dataset::Pose3d& pose, double rate_hz);

/// How a marker moves, for judging a filter.
struct MarkerMotion {
  std::string name;
  int measured = 0, filled = 0, missing = 0;     ///< frames
  int missing_at_start = 0, missing_at_end = 0;  ///< of these, those before the first and after the last position
  double acceleration_m_s2 = 0;                  ///< rms of second differences of consecutive positions; NaN with fewer than 3
};

std::vector<MarkerMotion> MeasureMotion(const MarkerTake& take);

/// rms over all markers; NaN when there is none.
double MeanAcceleration(const std::vector<MarkerMotion>& motions);

/// Distances between the same positions of two takes of the same shape.
struct Displacement {
  double rms_m = 0, max_m = 0;
  double rms_sigmas = 0;  ///< over the positions that have a sigma; NaN when none has
  struct Move {
    int marker = 0, frame_idx = 0;
    double distance_m = 0;
    double sigmas = 0;  ///< distance over sqrt(3) of its sigma; NaN without one
  };
  std::vector<Move> largest;  ///< ten at most, farthest first; those of one marker are half a second or more apart
};

Displacement MeasureDisplacement(const MarkerTake& before, const MarkerTake& after);

}  // namespace mvstudio::markers
