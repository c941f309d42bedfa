#include "report/page/value.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "core/error.h"
#include "core/json_view.h"

namespace mvstudio::report {
namespace {

using Json = nlohmann::ordered_json;
constexpr size_t kMaxDepth = 64, kFewFields = 32;

Value FromJson(const Json& json) {
  switch (json.type()) {
    case Json::value_t::boolean:
      return json.get<bool>();
    case Json::value_t::number_integer:
      return json.get<int64_t>();
    case Json::value_t::number_unsigned: {
      const uint64_t number = json.get<uint64_t>();
      if (number > static_cast<uint64_t>(INT64_MAX)) return static_cast<double>(number);
      return static_cast<int64_t>(number);
    }
    case Json::value_t::number_float:
      return json.get<double>();
    case Json::value_t::string:
      return json.get<std::string>();
    case Json::value_t::array: {
      Value array = Value::Array();
      for (const Json& item : json) array.Append(FromJson(item));
      return array;
    }
    case Json::value_t::object: {
      Value object = Value::Object();
      for (const auto& [key, item] : json.items()) object.Set(key, FromJson(item));
      return object;
    }
    default:
      return {};
  }
}

Json ToJson(const Value& value) {
  switch (value.kind()) {
    case Value::Kind::kBool:
      return value.Flag();
    case Value::Kind::kInteger:
      return value.integer();
    case Value::Kind::kNumber:
      return std::isfinite(value.Number()) ? Json(value.Number()) : Json();
    case Value::Kind::kText:
      return value.Text();
    case Value::Kind::kArray: {
      Json array = Json::array();
      for (const Value& item : value.items()) array.push_back(ToJson(item));
      return array;
    }
    case Value::Kind::kObject: {
      Json object = Json::object();
      auto& fields = object.get_ref<Json::object_t&>();  // whose keys differ: looking for them again is quadratic
      for (const auto& [key, item] : value.fields()) fields.Json::object_t::Container::emplace_back(key, ToJson(item));
      return object;
    }
    default:
      return {};
  }
}

}  // namespace

Value Value::Parse(const std::string& json_text, const std::string& path_for_messages) {
  if (json_text.empty()) throw FormatError(path_for_messages, "", "the file is empty");
  return FromJson(JsonFromText<Json>(json_text, {kMaxDepth, false}, path_for_messages));
}

std::string Value::Dump(int indent) const { return ToJson(*this).dump(indent, ' ', false, Json::error_handler_t::replace); }

size_t Value::IndexOf(const std::string& key) const {
  if (index_) {
    const auto found = index_->find(key);
    return found == index_->end() ? fields_.size() : found->second;
  }
  const auto found = std::find_if(fields_.begin(), fields_.end(), [&](const auto& field) { return field.first == key; });
  return static_cast<size_t>(found - fields_.begin());
}

const Value& Value::operator[](const std::string& key) const {
  static const Value null;
  const size_t index = IndexOf(key);
  return index == fields_.size() ? null : fields_[index].second;
}

const Value& Value::Path(const std::string& dotted) const {
  const Value* value = this;
  for (size_t begin = 0; begin <= dotted.size();) {
    const size_t end = std::min(dotted.find('.', begin), dotted.size());
    value = &(*value)[dotted.substr(begin, end - begin)];
    begin = end + 1;
  }
  return *value;
}

const Value& Value::At(size_t index) const {
  static const Value null;
  return index < items_.size() ? items_[index] : null;
}

double Value::Number(double fallback) const {
  if (kind_ == Kind::kInteger) return static_cast<double>(integer_);
  return kind_ == Kind::kNumber ? number_ : fallback;
}

double Value::FirstNumber(const std::vector<std::string>& keys) const {
  for (const std::string& key : keys) {
    const double number = Path(key).Number();
    if (std::isfinite(number)) return number;
  }
  return std::numeric_limits<double>::quiet_NaN();
}

Value& Value::Set(const std::string& key, Value value) {
  if (kind_ == Kind::kNull) kind_ = Kind::kObject;
  const size_t index = IndexOf(key);
  if (index < fields_.size()) {
    fields_[index].second = std::move(value);
    return *this;
  }
  fields_.emplace_back(key, std::move(value));
  if (fields_.size() <= kFewFields) return *this;
  if (!index_ || index_.use_count() > 1) {
    index_ = std::make_shared<std::map<std::string, size_t>>();
    for (size_t i = 0; i < fields_.size(); ++i) index_->emplace(fields_[i].first, i);
  } else {
    index_->emplace(key, index);
  }
  return *this;
}

Value& Value::Append(Value value) {
  if (kind_ == Kind::kNull) kind_ = Kind::kArray;
  items_.push_back(std::move(value));
  return *this;
}

}  // namespace mvstudio::report
