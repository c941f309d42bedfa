#include "calib/calibrate_options.h"

#include <algorithm>

#include "core/error.h"
#include "core/join.h"

namespace mvstudio::calib {
namespace {

constexpr ChoiceWords<LensSharing::Kind, 3> kSharings = {
    {{LensSharing::Kind::kAuto, "auto"}, {LensSharing::Kind::kNone, "none"}, {LensSharing::Kind::kAll, "all"}}};
constexpr ChoiceWords<TimeOffsetChoice, 4> kTimeOffsetChoices = {{{TimeOffsetChoice::kAuto, "auto"},
                                                                  {TimeOffsetChoice::kOn, "on"},
                                                                  {TimeOffsetChoice::kClocks, "clocks"},
                                                                  {TimeOffsetChoice::kNone, "none"}}};
constexpr ChoiceWords<HeldPart::What, 2> kHeldParts = {
    {{HeldPart::What::kLenses, "lenses"}, {HeldPart::What::kPoses, "poses"}}};
constexpr ChoiceWords<Engine, 2> kEngines = {{{Engine::kMvstudio, "mvstudio"}, {Engine::kMrcal, "mrcal"}}};

std::vector<std::string> SplitNames(const std::string& text, char separator) {
  std::vector<std::string> parts;
  for (size_t begin = 0; begin <= text.size();) {
    const size_t end = std::min(text.find(separator, begin), text.size());
    parts.push_back(text.substr(begin, end - begin));
    begin = end + 1;
  }
  return parts;
}

/// A whole number of at most `most_digits` digits, fewer than 19; -1 for anything else.
int64_t ParseDigits(const std::string& text, size_t most_digits) {
  const bool ok = !text.empty() && text.size() <= most_digits && text.find_first_not_of("0123456789") == std::string::npos;
  return ok ? std::stoll(text) : -1;
}

}  // namespace

std::string ToString(const LensSharing& sharing) {
  if (sharing.kind != LensSharing::Kind::kGroups) return std::string(WordOf(kSharings, sharing.kind));
  return Join(sharing.groups, ";", [](const auto& names) { return Join(names, ","); });
}

void FromString(const std::string& text, LensSharing* sharing) {
  if (const auto kind = ChoiceOf(kSharings, text)) {
    *sharing = {*kind, {}};
    return;
  }
  *sharing = {LensSharing::Kind::kGroups, {}};
  for (const std::string& group : SplitNames(text, ';')) sharing->groups.push_back(SplitNames(group, ','));
}

std::string_view ToString(TimeOffsetChoice time_offset) { return WordOf(kTimeOffsetChoices, time_offset); }

void FromString(const std::string& text, TimeOffsetChoice* time_offset) {
  *time_offset = KnownChoice(kTimeOffsetChoices, text, "option 'time-offset' " + text + ": expected auto, on, clocks or none");
}

std::string ToString(const WorldOrigin& origin) {
  if (origin.board_frame) return "board:" + std::to_string(*origin.board_frame);
  return origin.camera.empty() ? "camera" : "camera:" + origin.camera;
}

void FromString(const std::string& text, WorldOrigin* origin) {
  constexpr size_t kMostDigits = 9;
  const auto colon = text.find(':');
  const std::string kind = text.substr(0, colon), value = colon == std::string::npos ? "" : text.substr(colon + 1);
  if (kind == "camera") {
    *origin = {value, std::nullopt};
    return;
  }
  const int64_t frame = ParseDigits(value, kMostDigits);
  if (kind != "board" || frame < 0)
    throw UsageError("option 'world' " + text + ": expected camera, camera:NAME or board:FRAME");
  *origin = {"", frame};
}

std::string ToString(const HoldoutRule& rule) {
  if (rule.step == 0) return "";
  return "every:" + std::to_string(rule.step) + (rule.first == rule.step - 1 ? "" : ":" + std::to_string(rule.first));
}

void FromString(const std::string& text, HoldoutRule* rule) {
  constexpr size_t kMostDigits = 6;
  const std::string rest = text.rfind("every:", 0) == 0 ? text.substr(6) : "";
  const auto colon = rest.find(':');
  HoldoutRule read;
  read.step = static_cast<int>(ParseDigits(rest.substr(0, colon), kMostDigits));
  read.first = colon == std::string::npos ? read.step - 1 : static_cast<int>(ParseDigits(rest.substr(colon + 1), kMostDigits));
  if (read.step < 2 || read.first < 0 || read.first >= read.step)
    throw UsageError("option 'holdout' " + text + ": expected every:N with N at least 2, or every:N:K with K from 0 to N - 1");
  *rule = read;
}

std::string ToString(const CameraSplit& split) {
  return split.camera + ":" + std::to_string(split.frame_idx) + (split.second_lens ? ":lens" : "");
}

void FromString(const std::string& text, CameraSplit* split) {
  constexpr size_t kMostDigits = 9;
  const std::string suffix = ":lens";
  std::string rest = text;
  CameraSplit read;
  if (rest.size() > suffix.size() && rest.compare(rest.size() - suffix.size(), suffix.size(), suffix) == 0) {
    read.second_lens = true;
    rest.resize(rest.size() - suffix.size());
  }
  const auto colon = rest.rfind(':');  // names may hold colons
  read.frame_idx = colon == std::string::npos ? -1 : ParseDigits(rest.substr(colon + 1), kMostDigits);
  if (read.frame_idx < 0) throw UsageError("option 'split-at' " + text + ": expected CAMERA:FRAME or CAMERA:FRAME:lens");
  read.camera = rest.substr(0, colon);
  *split = read;
}

std::string ToString(const HeldPart& part) {
  const std::string what(WordOf(kHeldParts, part.what));
  return part.cameras.empty() ? what : what + ":" + Join(part.cameras, ",");
}

void FromString(const std::string& text, HeldPart* part) {
  const auto colon = text.find(':');
  const auto what =
      KnownChoice(kHeldParts, text.substr(0, colon), "option 'fix' " + text + ": expected lenses, poses, or lenses:NAME,NAME");
  *part = {what, {}};
  if (colon != std::string::npos) part->cameras = SplitNames(text.substr(colon + 1), ',');
}

std::string_view ToString(Engine engine) { return WordOf(kEngines, engine); }

void FromString(const std::string& text, Engine* engine) {
  *engine = KnownChoice(kEngines, text, "option 'engine' " + text + ": expected mvstudio or mrcal");
}

}  // namespace mvstudio::calib
