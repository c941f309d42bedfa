#include "dataset/panoptic/panoptic_json.h"

#include <algorithm>

#include "dataset/json/json_file.h"
#include "dataset/panoptic/panoptic_units.h"

namespace mvstudio::dataset::internal {

PanopticExtras ExtrasOf(const JsonView& object, std::initializer_list<const char*> known) {
  PanopticExtras extras;
  for (const auto& [key, value] : object.value().items()) {
    const std::string& name = key;
    const bool is_known = std::any_of(known.begin(), known.end(), [&](const char* k) { return name == k; });
    if (!is_known) extras.emplace_back(name, value.dump());
  }
  return extras;
}

std::string ExtrasText(const PanopticExtras& extras, const std::string& indent) {
  std::string text;
  for (const auto& [key, value] : extras) text += ",\n" + indent + JsonText(key) + ": " + value;
  return text;
}

std::string NumbersText(const std::vector<double>& numbers, const char* separator) {
  std::string text;
  for (size_t i = 0; i < numbers.size(); ++i) text += (i ? separator : "") + StreamNumberText(numbers[i]);
  return text;
}

std::string JsonText(const std::string& text) { return Json(text).dump(-1, ' ', false, Json::error_handler_t::replace); }

std::optional<double> OptionalNumber(const JsonView& object, const char* key) {
  return object.Has(key) ? std::optional(object[key].Number()) : std::nullopt;
}

std::optional<std::string> OptionalText(const JsonView& object, const char* key) {
  return object.Has(key) ? std::optional(object[key].Text()) : std::nullopt;
}

void RequireObject(const JsonView& view) {
  if (!view.value().is_object()) view.Fail("must be an object");
}

}  // namespace mvstudio::dataset::internal
