#include <algorithm>
#include <cmath>
#include <cstring>

#include "core/check.h"
#include "report/scene/scene.h"

namespace mvstudio::report {
namespace {

constexpr double kFinest = 1e-4, kFarthest = 1e12, kNarrowSteps = 65534, kWideSteps = 4294967294.0;

template <class T>
void AppendBytes(T value, std::string* out) {
  char bytes[sizeof(T)];
  std::memcpy(bytes, &value, sizeof(T));
  out->append(bytes, sizeof(T));
}

bool HasPosition(const SceneJoint& joint) {
  return std::all_of(joint.at_m.begin(), joint.at_m.end(), [](double v) { return std::abs(v) <= kFarthest; });
}

/// xx, yy, zz among xx xy xz yy yz zz.
constexpr size_t kDiagonal[] = {0, 3, 5};

/// 0 for unknown; else 1 to 255 in equal ratios from `least`.
uint8_t LogCode(double value, double least, double per_octave) {
  if (!std::isfinite(value) || value < 0) return 0;
  const double code = 1 + per_octave * std::log2(std::max(value, least) / least);
  return static_cast<uint8_t>(std::lround(std::min(code, 255.0)));
}

int8_t CorrelationCode(double covariance, double a, double b) {
  const double correlation = a > 0 && b > 0 ? covariance / std::sqrt(a) / std::sqrt(b) : 0;
  return std::isfinite(correlation) ? static_cast<int8_t>(std::lround(127 * std::clamp(correlation, -1.0, 1.0))) : int8_t{0};
}

/// How the coordinates of one person are kept.
struct Lattice {
  std::array<double, 3> origin{};
  double step = 1;
  uint32_t width = 2;
};

Lattice LatticeOf(const ScenePeople& people, size_t person, size_t first, size_t count) {
  std::array<double, 3> low, high;
  low.fill(kFarthest), high.fill(-kFarthest);
  double needed = kFinest;
  bool any = false;
  for (size_t step = first; step < first + count; ++step) {
    for (size_t j = 0; j < people.joints.size(); ++j) {
      const SceneJoint& joint = people.At(step, person, j);
      if (!HasPosition(joint)) continue;
      any = true;
      for (size_t i = 0; i < 3; ++i) {
        low[i] = std::min(low[i], joint.at_m[i]), high[i] = std::max(high[i], joint.at_m[i]);
        const double variance = joint.covariance_m2[kDiagonal[i]];
        if (variance > 0) needed = std::min(needed, 0.1 * std::sqrt(variance));
      }
    }
  }
  Lattice lattice;
  if (!any) return lattice;
  lattice.origin = low;
  double extent = 0;
  for (size_t i = 0; i < 3; ++i) extent = std::max(extent, high[i] - low[i]);
  if (extent / kNarrowSteps <= needed) {
    lattice.step = extent > 0 ? extent / kNarrowSteps : 1;
  } else {
    lattice.width = 4;
    lattice.step = std::max(needed, extent / kWideSteps);
  }
  return lattice;
}

void AppendRecord(const SceneJoint& joint, const Lattice& lattice, std::string* out) {
  const bool there = HasPosition(joint);
  for (size_t i = 0; i < 3; ++i) {
    const double steps = there ? std::round((joint.at_m[i] - lattice.origin[i]) / lattice.step) : -1;
    if (lattice.width == 2) {
      AppendBytes(there ? static_cast<uint16_t>(std::clamp(steps, 0.0, kNarrowSteps)) : uint16_t{0xffff}, out);
    } else {
      AppendBytes(there ? static_cast<uint32_t>(std::clamp(steps, 0.0, kWideSteps)) : uint32_t{0xffffffff}, out);
    }
  }
  const auto& c = joint.covariance_m2;
  for (const size_t i : kDiagonal) AppendBytes(LogCode(there ? std::sqrt(c[i]) : NAN, 1e-6, 8), out);
  AppendBytes(CorrelationCode(c[1], c[0], c[3]), out);
  AppendBytes(CorrelationCode(c[2], c[0], c[5]), out);
  AppendBytes(CorrelationCode(c[4], c[3], c[5]), out);
  AppendBytes(static_cast<uint8_t>(std::clamp(joint.num_views, 0, 255)), out);
  AppendBytes(LogCode(joint.rms_px, 0.01, 12), out);
}

}  // namespace

size_t PackedSize(size_t count, size_t joints, const std::vector<size_t>& widths) {
  size_t size = 16 + 40 * widths.size();
  for (const size_t width : widths) size += count * joints * (3 * width + 8);
  return size;
}

std::string PackPeople(const ScenePeople& people, size_t first, size_t count) {
  MVS_CHECK(first + count <= people.frames.size() &&
                people.cells.size() == people.frames.size() * people.people.size() * people.joints.size(),
            "time steps " << first << " to " << first + count << " of " << people.frames.size());
  std::string out;
  for (const size_t number : {first, count, people.people.size(), people.joints.size()})
    AppendBytes(static_cast<uint32_t>(number), &out);
  std::vector<Lattice> lattices;
  for (size_t person = 0; person < people.people.size(); ++person) {
    lattices.push_back(LatticeOf(people, person, first, count));
    for (const double number : lattices[person].origin) AppendBytes(number, &out);
    AppendBytes(lattices[person].step, &out);
    AppendBytes(lattices[person].width, &out);
    AppendBytes(uint32_t{0}, &out);
  }
  for (size_t person = 0; person < people.people.size(); ++person) {
    for (size_t step = first; step < first + count; ++step) {
      for (size_t j = 0; j < people.joints.size(); ++j) AppendRecord(people.At(step, person, j), lattices[person], &out);
    }
  }
  return out;
}

}  // namespace mvstudio::report
