#include <algorithm>
#include <functional>
#include <optional>
#include <set>
#include <utility>

#include "core/format.h"
#include "core/join.h"
#include "core/text/shell_word.h"
#include "triangulate/take/cause_trials.h"
#include "triangulate/take/share_range.h"

namespace mvstudio::triangulate::internal {
namespace {

using geometry::Camera;
using geometry::Rig;

/// A change of the detections of one camera, or of all with -1.
using ChangePixel = std::function<void(const Camera&, DetectedPerson*)>;

struct Detected {
  Cause cause;
  std::string text;    ///< "the images@ mirrored"; @: of which cameras
  std::string option;  ///< that mends all cameras; of one, its name follows `join`
  std::string join;
  ChangePixel change;
};

/// Of the cameras `whose`; empty: all.
void AddDetected(const Rig& rig, const std::vector<DetectedFrame>& frames, const Detected& detected,
                 const std::vector<size_t>& whose, std::vector<Assumption>* list) {
  const auto name = [&](size_t c) { return rig.cameras[c].camera.name; };
  const auto option = [&](const std::string& named) {
    std::string text = detected.option;
    for (size_t at = text.find('@'); at != std::string::npos; at = text.find('@', at + named.size()))  // names have @, too
      text.replace(at, 1, named);
    return text;
  };
  const auto option_of = [&](size_t c) {
    return option(detected.join + ShellWord(name(c)) + (detected.join == " " ? "" : "="));
  };
  std::string text = detected.text;
  text.replace(text.find('@'), 1, whose.empty() ? " of all cameras" : " of " + Join(whose, ", ", name));
  Assumption& other = list->emplace_back(
      Assumption{detected.cause, "with " + text, whose.empty() ? option("") : Join(whose, " ", option_of), rig, frames});
  for (DetectedFrame& frame : other.frames) {
    for (size_t c = 0; c < frame.people.size(); ++c) {
      if (!whose.empty() && std::find(whose.begin(), whose.end(), c) == whose.end()) continue;
      for (DetectedPerson& person : frame.people[c]) detected.change(rig.cameras[c].camera, &person);
    }
  }
}

/// Which cameras may be concerned alike: all of them (empty); each; and, where `several`, each two, all but one and, of six
/// cameras at most, all but two.
std::vector<std::vector<size_t>> Concerned(size_t num_cameras, bool alike, bool several) {
  constexpr size_t kMostForTwo = 6;
  std::vector<std::vector<size_t>> list = {{}};
  if (alike) return list;
  for (size_t a = 0; a < num_cameras; ++a) list.push_back({a});
  if (!several) return list;
  std::set<std::vector<size_t>> sets;
  for (size_t a = 0; a < num_cameras; ++a) {
    for (size_t b = a; b < num_cameras; ++b) {
      std::vector<size_t> others;
      for (size_t c = 0; c < num_cameras; ++c) {
        if (c != a && c != b) others.push_back(c);
      }
      if (a != b) sets.insert({a, b});
      if (others.size() >= 2 && (a == b || num_cameras <= kMostForTwo)) sets.insert(others);
    }
  }
  list.insert(list.end(), sets.begin(), sets.end());
  return list;
}

template <class Change>
ChangePixel EachKey(Change change) {
  return [change](const Camera& camera, DetectedPerson* person) {
    for (Keypoint& key : *person) change(camera, &key.px);
  };
}

/// What the coordinates of a camera count, where all that it sees lies near pixel 0, so that it can be parts of the image.
std::optional<ShareRange> SharesOf(const std::vector<DetectedFrame>& frames, size_t camera) {
  Coordinates all;
  for (const DetectedFrame& frame : frames) {
    for (const DetectedPerson& person : frame.people[camera]) {
      for (const Keypoint& key : person) {
        if (!(key.score > 0) || !key.px.allFinite()) continue;
        all.Add(key.px.x()), all.Add(key.px.y());
      }
    }
  }
  const ShareRange range = all.Range();
  const bool within = all.num > 0 && range.Share(all.least) >= -0.5 && range.Share(all.most) <= 1.5;
  return within ? std::optional(range) : std::nullopt;
}

void AddNormalized(const Rig& rig, const std::vector<DetectedFrame>& frames, std::vector<Assumption>* list) {
  std::vector<std::string> names;
  ShareRange last;
  Assumption other{Cause::kNormalized, "", "", rig, frames};
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    const std::optional<ShareRange> range = SharesOf(frames, c);
    if (!range) continue;
    const Camera& camera = rig.cameras[c].camera;
    names.push_back(camera.name), last = *range;
    for (DetectedFrame& frame : other.frames) {
      for (DetectedPerson& person : frame.people[c]) {
        for (Keypoint& key : person)
          key.px = {range->Share(key.px.x()) * camera.width_px, range->Share(key.px.y()) * camera.height_px};
      }
    }
  }
  if (names.empty()) return;
  const bool all = names.size() == rig.cameras.size();
  other.text = "with the coordinates of " + (all ? std::string("all cameras") : Join(names, ", ")) +
               Format(", which lie within %g to %g, as parts of the image's size", last.low, last.high);
  other.remedy = "option 'normalized'" + (all ? "" : " " + ShellWord(Join(names, ",")));
  list->push_back(std::move(other));
}

/// Row and column for x and y, as arrays are indexed: mirrored images rotated by 90 degrees.
void AddRowsFirst(const Rig& rig, const std::vector<DetectedFrame>& frames, std::vector<Assumption>* list) {
  Assumption other{Cause::kRotated, "with y before x in all cameras", "option 'rotate' 90 option 'flip-x'", rig, frames};
  for (DetectedFrame& frame : other.frames) {
    for (std::vector<DetectedPerson>& people : frame.people) {
      for (DetectedPerson& person : people) {
        for (Keypoint& key : person) std::swap(key.px.x(), key.px.y());
      }
    }
  }
  list->push_back(std::move(other));
}

/// The changes of detections that may concern all cameras, some or one.
std::vector<Detected> DetectedChanges(const MirrorGroups& mirror) {
  using Px = Eigen::Vector2d;
  const auto mirrored = [](const Camera& camera, Px* px) { px->x() = camera.width_px - 1 - px->x(); };
  std::vector<Detected> list;
  list.push_back({Cause::kFlippedY, "y counted from the lower edge@", "option 'flip-y'@", " ",
                  EachKey([](const Camera& camera, Px* px) { px->y() = camera.height_px - px->y(); })});
  // Turned back: the images are turned clockwise.
  list.push_back({Cause::kRotated, "the images@ turned by 90 degrees", "option 'rotate' @90", "",
                  EachKey([](const Camera& camera, Px* px) { *px = Px(px->y(), camera.height_px - 1 - px->x()); })});
  list.push_back({Cause::kRotated, "the images@ turned by 180 degrees", "option 'rotate' @180", "",
                  EachKey([](const Camera& camera, Px* px) { *px = Px(camera.width_px - 1, camera.height_px - 1) - *px; })});
  list.push_back({Cause::kRotated, "the images@ turned by 270 degrees", "option 'rotate' @270", "",
                  EachKey([](const Camera& camera, Px* px) { *px = Px(camera.width_px - 1 - px->y(), px->x()); })});
  list.push_back({Cause::kMirrored, "the images@ mirrored", "option 'flip-x'@", " ", EachKey(mirrored)});
  if (mirror.empty()) return list;
  // An image that is mirrored shows the left hand as a right one; a detector calls it so, markers keep their names.
  const auto with_sides = [mirror, mirrored](const Camera& camera, DetectedPerson* person) {
    EachKey(mirrored)(camera, person);
    for (const auto& group : mirror) {
      for (const auto& [left, right] : group) {
        std::swap((*person)[static_cast<size_t>(left)], (*person)[static_cast<size_t>(right)]);
      }
    }
  };
  list.push_back({Cause::kMirrored, "the images@ mirrored, left and right exchanged", "option 'flip-x'@ option 'swap-sides'@",
                  " ", with_sides});
  return list;
}

}  // namespace

void AddDetectedChanges(const Rig& rig, const std::vector<DetectedFrame>& frames, const MirrorGroups& mirror, bool alike,
                        std::vector<Assumption>* list) {
  AddNormalized(rig, frames, list);
  AddRowsFirst(rig, frames, list);
  for (const Detected& detected : DetectedChanges(mirror)) {
    for (const std::vector<size_t>& whose : Concerned(rig.cameras.size(), alike, detected.cause == Cause::kRotated))
      AddDetected(rig, frames, detected, whose, list);
  }
}

}  // namespace mvstudio::triangulate::internal
