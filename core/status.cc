#include "core/status.h"

#include <array>
#include <utility>

namespace mvstudio {
namespace {

constexpr std::array<std::pair<Status, std::string_view>, 11> kNames = {{
    {Status::kOk, "Ok"},
    {Status::kTooFewViews, "TooFewViews"},
    {Status::kLowParallax, "LowParallax"},
    {Status::kDegenerate, "Degenerate"},
    {Status::kBehindCamera, "BehindCamera"},
    {Status::kFarPoint, "FarPoint"},
    {Status::kOutlier, "Outlier"},
    {Status::kNonFiniteInput, "NonFiniteInput"},
    {Status::kOutsideValidRadius, "OutsideValidRadius"},
    {Status::kNotConverged, "NotConverged"},
    {Status::kUndefined, "Undefined"},
}};

}  // namespace

std::string_view ToString(Status status) {
  for (const auto& [value, name] : kNames) {
    if (value == status) return name;
  }
  return "Unknown";
}

std::optional<Status> StatusFromString(std::string_view text) {
  for (const auto& [value, name] : kNames) {
    if (name == text) return value;
  }
  return std::nullopt;
}

}  // namespace mvstudio
