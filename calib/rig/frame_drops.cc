#include "calib/rig/frame_drops.h"

#include <algorithm>
#include <cstdlib>
#include <set>
#include <tuple>

#include "core/format.h"

namespace mvstudio::calib {
namespace {

/// What would make one step of one pair: of b, or of a the other way round.
struct Cause {
  size_t step = 0;  // which one: both causes of a step have the same
  int other = 0;    // the pair's other camera
  FrameDrop drop;
};

/// Whether two pairs speak of the same drop: a pair knows its place to some frames only.
bool SameDrop(const FrameDrop& x, const FrameDrop& y) {
  constexpr int64_t kNear = 3;
  return x.camera_idx == y.camera_idx && x.count == y.count && x.last_before <= y.frame + kNear &&
         y.last_before <= x.frame + kNear;
}

std::vector<Cause> CausesOf(const FrameOffsets& offsets) {
  std::vector<Cause> causes;
  size_t step = 0;
  for (const FramePair& pair : offsets.pairs) {
    if (pair.kind != FramePair::Kind::kInconsistent || !pair.steps_supported) continue;
    for (size_t k = 1; k < pair.steps.size(); ++k, ++step) {
      const FrameStep &before = pair.steps[k - 1], &after = pair.steps[k];
      const int64_t count = after.shift - before.shift;
      causes.push_back({step, pair.a, {pair.b, after.last_before, after.frame, count}});
      causes.push_back({step, pair.b, {pair.a, after.last_before + before.shift, after.frame + after.shift, -count}});
    }
  }
  return causes;
}

/// Of the causes of one drop: the pairs' other cameras.
int Votes(const std::vector<Cause>& causes, const FrameDrop& drop) {
  std::set<int> others;
  for (const Cause& cause : causes) {
    if (SameDrop(cause.drop, drop)) others.insert(cause.other);
  }
  return static_cast<int>(others.size());
}

/// Pairs of the camera that speak of frame numbers: each of them must show what happened to its own.
int NumSpeaking(const FrameOffsets& offsets, int camera_idx) {
  return static_cast<int>(std::count_if(offsets.pairs.begin(), offsets.pairs.end(), [&](const FramePair& pair) {
    const bool undecided =
        pair.kind == FramePair::Kind::kUndecided || (pair.kind == FramePair::Kind::kInconsistent && !pair.steps_supported);
    return !undecided && (pair.a == camera_idx || pair.b == camera_idx);
  }));
}

/// The narrowest place that all pairs allow.
FrameDrop Merged(const std::vector<Cause>& causes, FrameDrop drop) {
  for (const Cause& cause : causes) {
    if (!SameDrop(cause.drop, drop)) continue;
    const int64_t low = std::max(drop.last_before, cause.drop.last_before), high = std::min(drop.frame, cause.drop.frame);
    if (low < high) drop.last_before = low, drop.frame = high;
  }
  return drop;
}

int64_t CountUpTo(const std::vector<FrameDrop>& drops, int camera_idx, int64_t frame) {
  int64_t sum = 0;
  for (const FrameDrop& drop : drops) sum += drop.camera_idx == camera_idx && drop.frame <= frame ? drop.count : 0;
  return sum;
}

}  // namespace

std::vector<FrameDrop> FindFrameDrops(const FrameOffsets& offsets) {
  std::vector<Cause> causes = CausesOf(offsets);
  std::vector<FrameDrop> drops;
  constexpr size_t kMost = 8;
  while (!causes.empty()) {
    if (drops.size() == kMost) return {};
    const auto by_most = [&](const Cause& cause) {
      return 2 * Votes(causes, cause.drop) > NumSpeaking(offsets, cause.drop.camera_idx);
    };
    const auto rank = [&](const Cause& cause) {
      return std::tuple(by_most(cause), Votes(causes, cause.drop), cause.drop.count > 0);
    };
    const auto best =
        std::max_element(causes.begin(), causes.end(), [&](const Cause& x, const Cause& y) { return rank(x) < rank(y); });
    if (!by_most(*best)) break;
    const FrameDrop drop = best->drop;
    drops.push_back(Merged(causes, drop));
    std::set<size_t> explained;
    for (const Cause& cause : causes) {
      if (SameDrop(cause.drop, drop)) explained.insert(cause.step);
    }
    const auto done = [&](const Cause& cause) { return explained.count(cause.step) > 0; };
    causes.erase(std::remove_if(causes.begin(), causes.end(), done), causes.end());
  }
  std::sort(drops.begin(), drops.end(), [](const FrameDrop& x, const FrameDrop& y) {
    return std::tie(x.camera_idx, x.frame) < std::tie(y.camera_idx, y.frame);
  });
  return drops;
}

std::string ToString(const std::vector<FrameDrop>& drops, const std::vector<std::string>& camera_names) {
  std::string text = drops.empty() ? "" : "frames with the same number were not taken at the same time: ";
  for (size_t k = 0; k < drops.size(); ++k) {
    const FrameDrop& drop = drops[k];
    const auto count = static_cast<long long>(std::llabs(drop.count)), last = static_cast<long long>(drop.last_before);
    text += (k == 0 ? "" : ", ") + camera_names[static_cast<size_t>(drop.camera_idx)] + (drop.count > 0 ? " lost " : " has ") +
            Format("%lld frame%s", count, count == 1 ? "" : "s") + (drop.count > 0 ? "" : " too many");
    if (drop.frame == drop.last_before + 1) {
      text += Format(" after frame %lld", last);
    } else {
      text += Format(" between frames %lld and %lld", last, static_cast<long long>(drop.frame));
    }
  }
  return text;
}

void ApplyFrameDrops(const std::vector<FrameDrop>& drops, std::vector<Detection>* detections) {
  const auto on_either_side = [&](const Detection& d) {
    return std::any_of(drops.begin(), drops.end(), [&](const FrameDrop& drop) {
      return d.camera_idx == drop.camera_idx && d.frame_idx > drop.last_before && d.frame_idx < drop.frame;
    });
  };
  detections->erase(std::remove_if(detections->begin(), detections->end(), on_either_side), detections->end());
  std::set<std::tuple<int, int64_t, int>> taken;
  const auto twice = [&](const Detection& d) { return !taken.insert({d.camera_idx, d.frame_idx, d.board_idx}).second; };
  for (Detection& d : *detections) d.frame_idx += CountUpTo(drops, d.camera_idx, d.frame_idx);
  detections->erase(std::remove_if(detections->begin(), detections->end(), twice), detections->end());
}

int64_t FrameBeforeDrops(const std::vector<FrameDrop>& drops, int camera_idx, int64_t frame) {
  int64_t own = frame;
  for (const FrameDrop& drop : drops) {
    if (drop.camera_idx == camera_idx && own - drop.count >= drop.frame) own -= drop.count;
  }
  return own;
}

}  // namespace mvstudio::calib
