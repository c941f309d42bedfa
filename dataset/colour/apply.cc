#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>

#include "core/check.h"
#include "dataset/colour/colour_match.h"
#include "dataset/colour/colour_space.h"

namespace mvstudio::dataset {
namespace {

constexpr ChoiceWords<ColourModelChoice, 4> kModelChoices = {{{ColourModelChoice::kAuto, "auto"},
                                                              {ColourModelChoice::kNone, "none"},
                                                              {ColourModelChoice::kGain, "gain"},
                                                              {ColourModelChoice::kGainOffset, "gain+offset"}}};
constexpr ChoiceWords<ColourSpaceChoice, 3> kSpaceChoices = {
    {{ColourSpaceChoice::kAuto, "auto"}, {ColourSpaceChoice::kLinear, "linear"}, {ColourSpaceChoice::kSrgb, "srgb"}}};

}  // namespace

namespace internal {

double LinearFromSrgb(double srgb) {
  const double size = std::abs(srgb);
  return std::copysign(size <= 0.04045 ? size / 12.92 : std::pow((size + 0.055) / 1.055, 2.4), srgb);
}

double SrgbFromLinear(double linear) {
  const double size = std::abs(linear);
  return std::copysign(size <= 0.0031308 ? 12.92 * size : 1.055 * std::pow(size, 1 / 2.4) - 0.055, linear);
}

double LinearSlope(double srgb) {
  const double size = std::abs(srgb);
  return size <= 0.04045 ? 1 / 12.92 : 2.4 / 1.055 * std::pow((size + 0.055) / 1.055, 1.4);
}

double ToSpace(double srgb, ColourSpace space) { return space == ColourSpace::kLinear ? LinearFromSrgb(srgb) : srgb; }

double Corrected(double srgb, const ColourTransform& t, int channel, ColourSpace space) {
  const double value = t.gain[channel] * ToSpace(srgb, space) + t.offset[channel];
  return space == ColourSpace::kLinear ? SrgbFromLinear(value) : value;
}

}  // namespace internal

std::string ToString(ColourModel model) {
  return model == ColourModel::kNone ? "none" : model == ColourModel::kGain ? "gain" : "gain+offset";
}
std::string ToString(ColourSpace space) { return space == ColourSpace::kLinear ? "linear" : "srgb"; }

std::string_view ToString(ColourModelChoice choice) { return WordOf(kModelChoices, choice); }
std::string_view ToString(ColourSpaceChoice choice) { return WordOf(kSpaceChoices, choice); }

void FromString(const std::string& text, ColourModelChoice* choice) {
  *choice = KnownChoice(kModelChoices, text, "colour-model '" + text + "': auto, none, gain or gain+offset");
}

void FromString(const std::string& text, ColourSpaceChoice* choice) {
  *choice = KnownChoice(kSpaceChoices, text, "colour-space '" + text + "': auto, linear or srgb");
}

void ApplyColour(const ColourTransform& transform, ColourSpace space, Image* rgb) {
  MVS_CHECK(rgb->channels == 3, rgb->channels << " channels; colours need three");
  if (transform.IsIdentity()) return;
  std::array<std::array<uint8_t, 256>, 3> table{};
  for (int k = 0; k < 3; ++k) {
    for (int level = 0; level < 256; ++level) {
      const double value = 255 * internal::Corrected(level / 255.0, transform, k, space);
      table[k][level] = static_cast<uint8_t>(std::lround(std::clamp(value, 0.0, 255.0)));
    }
  }
  for (size_t i = 0; i < rgb->pixels.size(); ++i) rgb->pixels[i] = table[i % 3][rgb->pixels[i]];
}

std::string ColourMatchToJsonText(const ColourMatch& match, const std::vector<std::string>& camera_names) {
  using Json = nlohmann::ordered_json;
  const auto triple = [](const Eigen::Array3d& a) { return Json::array({a[0], a[1], a[2]}); };
  Json json{{"status", ToString(match.status)}, {"reason", match.reason}, {"model", ToString(match.model)},
            {"space", ToString(match.space)},   {"points", match.points}, {"cameras", Json::array()}};
  for (size_t c = 0; c < match.cameras.size(); ++c) {
    const ColourTransform& t = match.cameras[c];
    json["cameras"].push_back({{"name", camera_names.at(c)},
                               {"status", ToString(t.status)},
                               {"gain", triple(t.gain)},
                               {"offset", triple(t.offset)},
                               {"gain_sigma", triple(t.gain_sigma)},
                               {"points", t.points}});
  }
  json["trials"] = Json::array();
  for (const ColourTrial& t : match.trials) {
    json["trials"].push_back({{"model", ToString(t.model)},
                              {"space", ToString(t.space)},
                              {"status", ToString(t.status)},
                              {"heldout_levels", t.heldout_levels},
                              {"heldout_gain", t.heldout_gain},
                              {"heldout_gain_sigma", t.heldout_gain_sigma}});
  }
  return json.dump(2) + "\n";
}

}  // namespace mvstudio::dataset
