#include "dataset/json_internal.h"

#include <cmath>
#include <limits>

#include "core/files.h"

namespace mvstudio::dataset::internal {

Json ParseJsonFile(const std::string& path) {
  const std::string text = ReadFile(path);
  constexpr int kMaxDepth = 64;
  const auto check_depth = [&path](int depth, Json::parse_event_t, Json&) {
    if (depth > kMaxDepth) throw FormatError(path, "", "is nested deeper than 64 levels");
    return true;
  };
  try {
    return Json::parse(text, check_depth);
  } catch (const nlohmann::json::parse_error& error) {
    throw FormatError(path, "byte " + std::to_string(error.byte), "is not valid JSON; cut short or damaged?");
  } catch (const nlohmann::json::exception& error) {
    throw FormatError(path, "", std::string("is not valid JSON: ") + error.what());
  }
}

JsonView JsonView::operator[](const char* key) const {
  if (!value_->is_object()) Fail("must be an object");
  const auto found = value_->find(key);
  const std::string where = where_.empty() ? key : where_ + "." + key;
  if (found == value_->end()) throw FormatError(*path_, where, "is missing");
  return JsonView(*path_, *found, where);
}

JsonView JsonView::operator[](size_t idx) const {
  const std::string where = where_ + "[" + std::to_string(idx) + "]";
  if (idx >= ArraySize()) throw FormatError(*path_, where, "is missing");
  return JsonView(*path_, (*value_)[idx], where);
}

size_t JsonView::ArraySize() const {
  if (!value_->is_array()) Fail("must be a list");
  return value_->size();
}

double JsonView::Number() const {
  if (!value_->is_number()) Fail("must be a number");
  const double number = value_->get<double>();
  if (!std::isfinite(number)) Fail("must be finite");
  return number;
}

int JsonView::Int() const {
  const double number = Number();
  if (number != std::floor(number) || std::abs(number) > std::numeric_limits<int>::max()) Fail("must be a whole number");
  return static_cast<int>(number);
}

std::string JsonView::Text() const {
  if (!value_->is_string()) Fail("must be a text");
  return value_->get<std::string>();
}

std::string NumberText(double value) { return Json(value).dump(); }

}  // namespace mvstudio::dataset::internal
