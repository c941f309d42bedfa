#include "dataset/json_internal.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <limits>
#include <unordered_set>

#include "core/files.h"

namespace mvstudio::dataset::internal {
namespace fs = std::filesystem;
namespace {

constexpr size_t kMaxDepth = 64;

/// Builds the value from the parser's events: unlike the library's own builder it refuses keys that are there twice, takes a
/// time that is linear in the number of keys, and knows the place of everything it refuses.
class Builder : public nlohmann::json_sax<Json> {
 public:
  explicit Builder(const std::string& path) : path_(path) {}
  Json Take() { return std::move(root_); }

  bool null() override { return Add(nullptr); }
  bool boolean(bool value) override { return Add(value); }
  /// The lexer calls this for texts that begin with a minus: zero is "-0".
  bool number_integer(int64_t value) override { return value == 0 ? Add(-0.0) : Add(value); }
  bool number_unsigned(uint64_t value) override { return Add(value); }
  bool number_float(double value, const std::string&) override { return Add(value); }
  bool string(std::string& value) override { return Add(std::move(value)); }
  bool binary(Json::binary_t&) override { return false; }
  bool start_object(size_t) override { return Open(Json::object()); }
  bool end_object() override { return Close(); }
  bool start_array(size_t) override { return Open(Json::array()); }
  bool end_array() override { return Close(); }

  bool key(std::string& name) override {
    Level& level = levels_.back();
    const auto& object = level.value->get_ref<const Json::object_t&>();
    bool twice = false;
    if (object.size() < 16) {
      twice = std::any_of(object.begin(), object.end(), [&](const auto& entry) { return entry.first == name; });
    } else {
      if (level.keys.empty()) {
        for (const auto& entry : object) level.keys.insert(entry.first);
      }
      twice = !level.keys.insert(name).second;
    }
    if (twice) throw FormatError(path_, Where(), "the key " + Quoted(name) + " is there twice");
    level.key = std::move(name);
    return true;
  }

  bool parse_error(size_t byte, const std::string&, const nlohmann::detail::exception& error) override {
    const std::string place = "byte " + std::to_string(byte);
    if (error.id == 406) throw FormatError(path_, place, "the number is beyond the range of doubles");
    throw FormatError(path_, place, "is not valid JSON; cut short or damaged?");
  }

 private:
  struct Level {
    Json* value;
    std::string key;
    std::unordered_set<std::string> keys;
  };

  template <class Value>
  bool Add(Value&& value) {
    Insert(Json(std::forward<Value>(value)));
    return true;
  }

  Json* Insert(Json&& value) {
    if (levels_.empty()) return &(root_ = std::move(value));
    Level& level = levels_.back();
    if (level.value->is_array()) {
      auto& list = level.value->get_ref<Json::array_t&>();
      list.push_back(std::move(value));
      return &list.back();
    }
    auto& object = level.value->get_ref<Json::object_t&>();
    object.Json::object_t::Container::emplace_back(level.key, std::move(value));
    return &object.back().second;
  }

  bool Open(Json&& value) {
    if (levels_.size() >= kMaxDepth)
      throw FormatError(path_, "", "is nested deeper than " + std::to_string(kMaxDepth) + " levels");
    Json* inserted = Insert(std::move(value));
    levels_.push_back({inserted, {}, {}});
    return true;
  }

  bool Close() {
    levels_.pop_back();
    return true;
  }

  /// Place of the innermost object or list that is open.
  std::string Where() const {
    std::string where;
    for (size_t i = 0; i + 1 < levels_.size(); ++i) {
      if (levels_[i].value->is_array()) {
        where += "[" + std::to_string(levels_[i].value->size() - 1) + "]";
      } else {
        where += (where.empty() ? "" : ".") + levels_[i].key;
      }
    }
    return where;
  }

  const std::string& path_;
  Json root_;
  std::vector<Level> levels_;
};

}  // namespace

Json ParseJson(std::string_view text, const std::string& path) {
  Builder builder(path);
  Json::sax_parse(text.begin(), text.end(), &builder);
  return builder.Take();
}

std::string ReadTextFile(const std::string& path, int64_t max_bytes) {
  std::error_code error;
  const auto status = fs::status(path, error);
  if (fs::exists(status) && !fs::is_regular_file(status)) throw IoError(path, "is not a regular file");
  const auto size = fs::file_size(path, error);
  if (!error && size > static_cast<uintmax_t>(max_bytes)) {
    throw FormatError(path, "",
                      "has " + std::to_string(size >> 20) + " MiB, such a file has at most " + std::to_string(max_bytes >> 20));
  }
  return ReadFile(path);
}

Json ParseJsonFile(const std::string& path, int64_t max_bytes) { return ParseJson(ReadTextFile(path, max_bytes), path); }

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

std::vector<double> JsonView::Numbers() const {
  std::vector<double> numbers(ArraySize());
  for (size_t i = 0; i < numbers.size(); ++i) {
    const Json& value = (*value_)[i];
    if (!value.is_number()) (*this)[i].Fail("must be a number");
    numbers[i] = value.get<double>();
  }
  return numbers;
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

std::string StreamNumberText(double value) {
  char text[40];
  for (int digits = 6; digits <= 17; ++digits) {
    std::snprintf(text, sizeof text, "%.*g", digits, value);
    if (std::strtod(text, nullptr) == value) break;
  }
  return text;
}

std::string Quoted(const std::string& text) {
  constexpr size_t kMaxBytes = 60;
  const std::string shown = Json(text.substr(0, kMaxBytes)).dump(-1, ' ', true, Json::error_handler_t::replace);
  return "'" + shown.substr(1, shown.size() - 2) + (text.size() > kMaxBytes ? "…" : "") + "'";
}

}  // namespace mvstudio::dataset::internal
