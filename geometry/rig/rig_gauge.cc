#include "geometry/rig/rig_gauge.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <string_view>
#include <tuple>

namespace mvstudio::geometry {
namespace {

using Kind = RigGauge::Kind;

constexpr std::string_view kDistanceTo = ", its distance to ", kStatedLengths = "size by stated lengths",
                           kRelativeTo = "; uncertainty relative to ";

/// How the sentence of a kind begins; where `more` is true, the camera, the frame or the words follow. A text is of the first
/// kind that fits.
struct Row {
  Kind kind;
  std::string_view text;
  bool more;
};

constexpr std::array<Row, 10> kRows = {{
    {Kind::kImported, "as imported", false},
    {Kind::kLensesOnly, "none: lenses only, every camera in a frame of its own", false},
    {Kind::kCamera, "camera ", true},
    {Kind::kBoard, "board in frame ", true},
    {Kind::kSceneBoard, "the board in the scene", false},
    {Kind::kSceneBoard, "the board in frame ", true},
    {Kind::kPoints, "the marked points", false},
    {Kind::kFloor, "floor under people's feet", false},
    {Kind::kPanoptic, "Panoptic ", true},
    {Kind::kOther, "", true},
}};

std::string WorldFixedBy(const RigGauge& gauge) {
  for (const Row& row : kRows) {
    if (row.kind != gauge.kind || (gauge.kind == Kind::kSceneBoard && row.more != gauge.frame.has_value())) continue;
    std::string text(row.text);
    if (!row.more) return text;
    if (gauge.frame) return text + std::to_string(*gauge.frame);
    text += gauge.camera + gauge.words;
    return gauge.distance_to.empty() ? text : text.append(kDistanceTo) + gauge.distance_to;
  }
  return "";  // kUnknown
}

/// What follows the row's text. False: nothing that the kind has.
bool ReadMore(std::string_view more, RigGauge* gauge) {
  if (gauge->kind == Kind::kBoard || gauge->kind == Kind::kSceneBoard) {
    int64_t frame = 0;
    const auto [stop, error] = std::from_chars(more.data(), more.data() + more.size(), frame);
    gauge->frame = frame;
    return error == std::errc() && stop == more.data() + more.size();
  }
  const size_t distance = gauge->kind == Kind::kCamera ? more.find(kDistanceTo) : std::string_view::npos;
  if (distance != std::string_view::npos) gauge->distance_to = more.substr(distance + kDistanceTo.size());
  (gauge->kind == Kind::kCamera ? gauge->camera : gauge->words) = more.substr(0, distance);
  return !more.empty();
}

RigGauge WorldFromText(std::string_view text) {
  for (const Row& row : kRows) {
    RigGauge gauge;
    gauge.kind = row.kind;
    const std::string_view more = text.substr(std::min(row.text.size(), text.size()));
    if (text.substr(0, row.text.size()) != row.text || (row.more ? !ReadMore(more, &gauge) : !more.empty())) continue;
    if (WorldFixedBy(gauge) == text) return gauge;  // not for a frame 07
  }
  return {};
}

/// Cuts the size from the end of the text.
bool TakeStatedLengths(std::string_view* text) {
  if (*text == kStatedLengths) return *text = "", true;
  const std::string end = ", " + std::string(kStatedLengths);
  if (text->size() <= end.size() || text->substr(text->size() - end.size()) != end) return false;
  return text->remove_suffix(end.size()), true;
}

}  // namespace

bool RigGauge::operator==(const RigGauge& other) const {
  const auto all = [](const RigGauge& g) {
    return std::tie(g.kind, g.camera, g.frame, g.words, g.distance_to, g.stated_lengths, g.relative_to);
  };
  return all(*this) == all(other);
}

bool RigGauge::IsUpright() const {
  return kind == Kind::kBoard || (kind == Kind::kSceneBoard && frame) || kind == Kind::kFloor || kind == Kind::kPanoptic;
}

RigGauge GaugeAfterMove(RigGauge world, const RigGauge& before) {
  world.relative_to = before.relative_to.empty() ? GaugeText(before) : before.relative_to;
  return world;
}

std::string GaugeText(const RigGauge& gauge) {
  std::string text = WorldFixedBy(gauge);
  if (gauge.stated_lengths) text += (text.empty() ? "" : ", ") + std::string(kStatedLengths);
  return gauge.relative_to.empty() ? text : text.append(kRelativeTo) + gauge.relative_to;
}

RigGauge GaugeFromText(const std::string& text) {
  const size_t tail = text.find(kRelativeTo);
  std::string_view world = std::string_view(text).substr(0, tail);
  const bool stated_lengths = TakeStatedLengths(&world);
  RigGauge gauge = WorldFromText(world);
  gauge.stated_lengths = stated_lengths;
  if (tail != std::string::npos) gauge.relative_to = text.substr(tail + kRelativeTo.size());
  return GaugeText(gauge) == text ? gauge : RigGauge::Other(text);
}

}  // namespace mvstudio::geometry
