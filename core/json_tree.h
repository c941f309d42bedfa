#pragma once

#include <algorithm>
#include <cctype>
#include <cstdint>
#include <numeric>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

/// Parses JSON into a tree of the library nlohmann::json in O(n log n). The library's own parsers are quadratic: an
/// ordered object compares a new key with all previous ones, and a parser with a callback scans the whole list after each
/// object in it. The library's type is a template parameter, so that this module does not depend on it.
namespace mvstudio {

struct JsonLimits {
  size_t max_depth = 64;
  bool refuse_twice = true;      ///< reject a repeated key in one object; otherwise the last value counts, at the first one's
                                 ///< place
  bool missing_as_null = false;  ///< NaN, Infinity and -Infinity, as Python's json writes them, become null; else kNotFinite
};

struct JsonProblem {
  enum class Kind { kNone, kSyntax, kNumber, kDepth, kTwice, kNotFinite };
  Kind kind = Kind::kNone;
  size_t byte = 0;         ///< of kSyntax and kNumber (beyond the range of doubles); beyond the text if it is truncated
  std::string where, key;  ///< of kTwice: the object, as in `cameras[3].K`, and the key; of kNotFinite: the value and its word
};

/// The word NaN, Infinity or -Infinity that begins at a byte; empty where another text does.
inline std::string_view NotFiniteWordAt(std::string_view text, size_t at) {
  const auto is_part = [](char c) { return std::isalnum(static_cast<unsigned char>(c)) || c == '_' || c == '-' || c == '.'; };
  for (const std::string_view word : {"NaN", "Infinity", "-Infinity"}) {
    if (text.substr(at, word.size()) != word || (at > 0 && is_part(text[at - 1]))) continue;
    if (at + word.size() == text.size() || !is_part(text[at + word.size()])) return word;
  }
  return {};
}

/// The text with null for these words outside of strings; `grown` holds the places, in the new text, behind which it has one
/// byte more than the old.
inline std::string WithNulls(std::string_view text, std::vector<size_t>* grown) {
  std::string nulls;
  nulls.reserve(text.size() + text.size() / 8);
  bool in_string = false;
  for (size_t i = 0; i < text.size();) {
    const char c = text[i];
    if (c == '"') in_string = !in_string;
    const size_t step = in_string && c == '\\' ? 2 : 1;
    const bool may = !in_string && (c == 'N' || c == 'I' || c == '-');
    const std::string_view word = may ? NotFiniteWordAt(text, i) : std::string_view();
    nulls += word.empty() ? std::string(text.substr(i, step)) : "null";
    if (word.size() > 4) nulls.append(word.size() - 4, ' ');
    if (word.size() == 3) grown->push_back(nulls.size());
    i += word.empty() ? step : word.size();
  }
  return nulls;
}

/// Receives the events of the library's parser. "-0" keeps its sign.
template <class Json>
class JsonTreeBuilder {
 public:
  explicit JsonTreeBuilder(const JsonLimits& limits) : limits_(limits) {}
  Json& root() { return root_; }
  const JsonProblem& problem() const { return problem_; }
  /// Place of the next value.
  std::string Next() const {
    if (levels_.empty()) return "";
    const Level& level = levels_.back();
    const std::string where = Where();
    if (level.value->is_array()) return where + "[" + std::to_string(level.value->size()) + "]";
    return where + (where.empty() ? "" : ".") + level.key;
  }

  bool null() { return Add(nullptr); }
  bool boolean(bool value) { return Add(value); }
  /// Called by the lexer for texts that begin with a minus: zero is "-0".
  bool number_integer(int64_t value) { return value == 0 ? Add(-0.0) : Add(value); }
  bool number_unsigned(uint64_t value) { return Add(value); }
  bool number_float(double value, const std::string&) { return Add(value); }
  bool string(std::string& value) { return Add(std::move(value)); }
  bool binary(typename Json::binary_t&) { return false; }
  bool start_object(size_t) { return Open(Json::object()); }
  bool start_array(size_t) { return Open(Json::array()); }
  bool end_array() { return Close(); }

  bool key(std::string& name) {
    levels_.back().key = std::move(name);
    return true;
  }

  bool end_object() {
    if constexpr (kKeepsOrder) {
      if (!MakeUnique(&levels_.back().value->template get_ref<Object&>())) return false;
    }
    return Close();
  }

  template <class Exception>
  bool parse_error(size_t byte, const std::string&, const Exception& error) {
    constexpr int kNumberOutOfRange = 406;
    problem_.kind = error.id == kNumberOutOfRange ? JsonProblem::Kind::kNumber : JsonProblem::Kind::kSyntax;
    problem_.byte = byte;
    return false;
  }

 private:
  using Object = typename Json::object_t;
  using Entries = std::vector<typename Object::value_type>;
  static constexpr bool kKeepsOrder = std::is_base_of_v<Entries, Object>;

  struct Level {
    Json* value;
    std::string key;
  };

  template <class Value>
  bool Add(Value&& value) {
    return Insert(Json(std::forward<Value>(value))) != nullptr;
  }

  Json* Insert(Json&& value) {
    if (levels_.empty()) return &(root_ = std::move(value));
    Level& level = levels_.back();
    if (level.value->is_array()) {
      auto& list = level.value->template get_ref<typename Json::array_t&>();
      list.push_back(std::move(value));
      return &list.back();
    }
    auto& object = level.value->template get_ref<Object&>();
    if constexpr (kKeepsOrder) {
      Entries& entries = object;
      entries.emplace_back(level.key, std::move(value));
      return &entries.back().second;
    } else {
      const auto [at, is_new] = object.insert_or_assign(level.key, std::move(value));
      if (is_new || !limits_.refuse_twice) return &at->second;
      return Twice(level.key);
    }
  }

  Json* Twice(const std::string& key) {
    problem_ = {JsonProblem::Kind::kTwice, 0, Where(), key};
    return nullptr;
  }

  bool Open(Json&& value) {
    if (levels_.size() >= limits_.max_depth) {
      problem_.kind = JsonProblem::Kind::kDepth;
      return false;
    }
    Json* inserted = Insert(std::move(value));
    if (!inserted) return false;
    levels_.push_back({inserted, {}});
    return true;
  }

  bool Close() {
    levels_.pop_back();
    return true;
  }

  /// Positions in the order of the keys, then of the text; empty when no key is repeated.
  static std::vector<size_t> TwinsByKey(const Entries& entries) {
    const auto same = [&](size_t a, size_t b) { return entries[a].first == entries[b].first; };
    std::vector<size_t> order;
    bool any = entries.size() > 16;
    for (size_t i = 0; !any && i < entries.size(); ++i) {
      for (size_t j = 0; j < i; ++j) any = any || same(i, j);
    }
    if (!any) return order;
    order.resize(entries.size());
    std::iota(order.begin(), order.end(), size_t{0});
    std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) { return entries[a].first < entries[b].first; });
    if (std::adjacent_find(order.begin(), order.end(), same) == order.end()) order.clear();
    return order;
  }

  bool MakeUnique(Entries* entries) {
    const std::vector<size_t> order = TwinsByKey(*entries);
    if (order.empty()) return true;
    std::vector<char> drop(entries->size(), 0);
    for (size_t i = 1, first = order[0]; i < order.size(); ++i) {
      auto& [key, value] = (*entries)[order[i]];
      if (key != (*entries)[first].first) {
        first = order[i];
        continue;
      }
      if (limits_.refuse_twice) return Twice(key) != nullptr;
      (*entries)[first].second = std::move(value);
      drop[order[i]] = 1;
    }
    Entries kept;
    for (size_t i = 0; i < entries->size(); ++i) {
      if (!drop[i]) kept.push_back(std::move((*entries)[i]));
    }
    entries->swap(kept);
    return true;
  }

  /// Place of the innermost open object or list.
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

  const JsonLimits limits_;
  Json root_;
  JsonProblem problem_;
  std::vector<Level> levels_;
};

/// `tree` is complete only when the problem is kNone.
template <class Json>
JsonProblem ParseJsonTree(std::string_view text, const JsonLimits& limits, Json* tree) {
  JsonTreeBuilder<Json> builder(limits);
  std::string nulls;
  std::vector<size_t> grown;
  const bool any = text.find("NaN") != std::string_view::npos || text.find("Infinity") != std::string_view::npos;
  if (limits.missing_as_null && any) nulls = WithNulls(text, &grown), text = nulls;
  Json::sax_parse(text.begin(), text.end(), &builder);
  JsonProblem problem = builder.problem();
  if (problem.kind == JsonProblem::Kind::kNone) *tree = std::move(builder.root());
  if (problem.kind == JsonProblem::Kind::kSyntax && any && problem.byte > 0) {
    const size_t at = problem.byte - 1;  // the lexer stops at the N, or behind the minus
    for (const size_t from : {at, at > 0 ? at - 1 : at}) {
      const std::string_view word = NotFiniteWordAt(text, from);
      if (!word.empty()) problem = {JsonProblem::Kind::kNotFinite, problem.byte, builder.Next(), std::string(word)};
    }
  }
  const auto before = [&](size_t place) { return place <= problem.byte; };
  problem.byte -= static_cast<size_t>(std::count_if(grown.begin(), grown.end(), before));
  return problem;
}

}  // namespace mvstudio
