#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace mvstudio::report {

/// A joint at a time step; without a position `at_m` is NaN.
struct SceneJoint {
  std::array<double, 3> at_m = {kUnknown, kUnknown, kUnknown};                                         ///< in the world
  std::array<double, 6> covariance_m2 = {kUnknown, kUnknown, kUnknown, kUnknown, kUnknown, kUnknown};  ///< xx xy xz yy yz zz
  int num_views = 0;
  double rms_px = kUnknown;

 private:
  static constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
};

/// People over time.
struct ScenePeople {
  std::vector<int64_t> frames;  ///< of each time step, ascending
  std::vector<int64_t> people;
  std::vector<std::string> joints;
  std::vector<std::pair<int, int>> bones;  ///< indices of joints
  double rate_hz = 0;                      ///< 0: unknown
  std::vector<SceneJoint> cells;           ///< [time step][person][joint]

  SceneJoint& At(size_t step, size_t person, size_t joint) {
    return cells[(step * people.size() + person) * joints.size() + joint];
  }
  const SceneJoint& At(size_t step, size_t person, size_t joint) const {
    return cells[(step * people.size() + person) * joints.size() + joint];
  }
};

/// Time steps [first, first + count) for the page's viewer, little-endian: uint32 first, count, people, joints; for each
/// person float64 origin x y z and step (m), uint32 width and 0; then for each person, time step and joint a record: three
/// unsigned coordinates of `width` (2 or 4) bytes in steps from the origin, all ones without a position; three bytes of
/// sigmas along x, y, z (0: unknown, else 1e-6 m * 2^((code - 1) / 8)); three signed bytes of the correlations xy, xz, yz
/// (x 127); one byte of views (255: that or more); one byte of the residual (0: unknown, else 0.01 px * 2^((code - 1) / 12)).
/// A step is at most a tenth of the person's smallest sigma and at most 0.1 mm, unless 2^32 of them do not reach.
/// A coordinate beyond 1e12 m counts as no position. Throws Error for time steps that are not there.
std::string PackPeople(const ScenePeople& people, size_t first, size_t count);

/// Bytes of such a chunk: 16 + 40 people + count * joints * (sum of 3 widths + 8).
size_t PackedSize(size_t count, size_t joints, const std::vector<size_t>& widths);

/// Residuals over time in at most `most` parts of equal length: the strip below the viewer.
struct SceneSpan {
  size_t first = 0;     ///< time step
  size_t worst = 0;     ///< time step of the largest residual, else of the most missing joints, in it
  double rms_px = 0;    ///< there: root of the mean of squares over its joints; NaN without one
  double missing = 0;   ///< share of the span's joints without a position
  size_t emptiest = 0;  ///< time step of the most missing joints
};
std::vector<SceneSpan> SpansOf(const ScenePeople& people, size_t most);

}  // namespace mvstudio::report
