#include <algorithm>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "calib/formats/opencv_yaml.h"
#include "core/error.h"

namespace mvstudio::calib::internal {
namespace {

constexpr int kMaxTables = 4;  // one in the other

bool IsStoredMatrix(const Value& value) {
  const auto has = [&](const char* key) {
    return std::any_of(value.entries.begin(), value.entries.end(), [&](const auto& entry) { return entry.first == key; });
  };
  return value.kind == Value::Kind::kTable && has("rows") && has("cols") && has("data");
}

bool IsCameraTable(const Value& table, std::initializer_list<const char*> matrix_keys) {
  return table.kind == Value::Kind::kTable && std::any_of(table.entries.begin(), table.entries.end(), [&](const auto& entry) {
           const bool named = std::any_of(matrix_keys.begin(), matrix_keys.end(),
                                          [&](const char* key) { return NormalisedKey(entry.first) == key; });
           return named && (entry.second.kind == Value::Kind::kList || IsStoredMatrix(entry.second));
         });
}

Entries EntriesIn(const Value& table, const Place& place) {
  Entries entries;
  for (const auto& [key, value] : table.entries) {
    const Place here{place.path, place.where + "." + Printable(key)};
    if (!entries.insert({NormalisedKey(key), {value, here}}).second)
      throw FormatError(place.path, here.where, "this key occurs twice");
  }
  return entries;
}

/// The table with the entries of its `intrinsics` and `extrinsics`, where these are tables of their own.
Value Flattened(const Value& table) {
  Value flat = table;
  flat.entries.clear();
  for (const auto& [key, value] : table.entries) {
    const std::string plain = NormalisedKey(key);
    const bool part = plain == "intrinsics" || plain == "intrinsic" || plain == "extrinsics" || plain == "extrinsic";
    if (part && value.kind == Value::Kind::kTable && !IsStoredMatrix(value)) {
      flat.entries.insert(flat.entries.end(), value.entries.begin(), value.entries.end());
    } else {
      flat.entries.emplace_back(key, value);
    }
  }
  return flat;
}

/// OKVIS states `focal_length` and `principal_point`, two numbers each: they become a camera matrix. Not to be asked of a table
/// that has one: its pairs may be millimetres.
Value WithMatrix(const Value& table) {
  const auto pair = [&](const char* key) -> const Value* {
    for (const auto& [name, value] : table.entries) {
      const bool two = value.kind == Value::Kind::kList && value.items.size() == 2;
      if (two && NormalisedKey(name) == key && value.items[0].kind == Value::Kind::kNumber &&
          value.items[1].kind == Value::Kind::kNumber)
        return &value;
    }
    return nullptr;
  };
  const Value *focal = pair("focallength"), *centre = pair("principalpoint");
  if (!focal || !centre) return table;
  Value matrix;
  matrix.kind = Value::Kind::kList, matrix.line = focal->line;
  for (const double number : {focal->items[0].number, 0.0, centre->items[0].number, 0.0, focal->items[1].number,
                              centre->items[1].number, 0.0, 0.0, 1.0}) {
    Value& item = matrix.items.emplace_back();
    item.kind = Value::Kind::kNumber, item.number = number;
  }
  Value whole = table;
  whole.entries.clear();
  for (const auto& [name, value] : table.entries) {
    const std::string plain = NormalisedKey(name);
    if (plain != "focallength" && plain != "principalpoint") whole.entries.emplace_back(name, value);
  }
  whole.entries.emplace_back("camera_matrix", std::move(matrix));
  return whole;
}

/// What the table calls itself, else `unless`.
std::string NameOf(const Entries& entries, const std::string& unless) {
  const Entry* const name = FindFirst(entries, {"name", "cameraname", "camera", "id", "cameraid", "serial", "serialnumber"});
  const bool said = name && !name->value.text.empty();
  return said ? name->value.text : unless;
}

using Visit = std::function<void(const Value&, const Place&, const std::string& name)>;

/// The values of a table or list, with their paths and names.
void ForEachIn(const Value& value, const Place& place, const std::string& name, const Visit& visit) {
  for (const auto& [key, child] : value.entries) visit(child, {place.path, place.where + "." + Printable(key)}, key);
  for (size_t i = 0; i < value.items.size(); ++i) {
    const std::string number = std::to_string(i);
    visit(value.items[i], {place.path, place.where + "[" + number + "]"}, name + number);
  }
}

bool CollectCameras(const Value& value, const Place& place, const std::string& name,
                    std::initializer_list<const char*> matrix_keys, int depth, std::vector<NestedCamera>* cameras) {
  Value flat = Flattened(value);
  if (!IsCameraTable(flat, matrix_keys)) flat = WithMatrix(flat);
  if (IsCameraTable(flat, matrix_keys)) {
    Entries entries = EntriesIn(flat, place);
    const std::string own = NameOf(entries, name);
    cameras->push_back({own, place.where, std::move(entries)});
    return true;
  }
  if (IsStoredMatrix(value) || depth > kMaxTables) return false;
  std::optional<Place> other;
  bool found = false;
  ForEachIn(value, place, name, [&](const Value& child, const Place& where, const std::string& child_name) {
    if (CollectCameras(child, where, child_name, matrix_keys, depth + 1, cameras)) {
      found = true;
    } else if (child.kind == Value::Kind::kTable || child.kind == Value::Kind::kList) {
      other = where;
    }
  });
  if (found && other)
    throw FormatError(other->path, other->where, "stands among cameras and is none: it has no camera_matrix, K or mtx");
  return found;
}

/// A file may hold one camera several times, as measured and rectified.
void RefuseEqualNames(const std::string& path, const std::vector<NestedCamera>& cameras) {
  std::map<std::string, std::string> known;
  for (const NestedCamera& camera : cameras) {
    const auto [at, is_new] = known.emplace(camera.name, camera.where);
    if (is_new) continue;
    throw FormatError(path, camera.where,
                      "is camera " + Printable(camera.name) + ", as is " + at->second +
                          ": leave one of the two in the file, or give each camera a name of its own");
  }
}

/// A key of a numbered camera: `camera_matrix_0`, `K_cam0` and `cam0_K` are stem and number; no number: none.
struct NumberedKey {
  std::string stem, number;
};

NumberedKey SplitNumber(const std::string& key) {
  const auto is_digit = [](char c) { return c >= '0' && c <= '9'; };
  for (const std::string word : {"camera", "cam"}) {  // before the stem: cam0k
    if (key.rfind(word, 0) != 0) continue;
    const auto begin = key.begin() + static_cast<std::ptrdiff_t>(word.size());
    const auto end = std::find_if_not(begin, key.end(), is_digit);
    if (end != begin && end != key.end()) return {std::string(end, key.end()), std::string(begin, end)};
  }
  const auto digits = std::find_if_not(key.rbegin(), key.rend(), is_digit).base();
  std::string stem(key.begin(), digits);
  for (const std::string word : {"camera", "cam"}) {  // behind it: kcam0
    if (stem.size() <= word.size() || stem.compare(stem.size() - word.size(), word.size(), word) != 0) continue;
    stem.resize(stem.size() - word.size());
    break;
  }
  return {stem, std::string(digits, key.end())};
}

void CollectMatrices(const Value& value, const Place& place, int depth, std::vector<std::string>* paths) {
  if (IsStoredMatrix(value)) return paths->push_back(place.where);
  if (depth > kMaxTables) return;
  ForEachIn(value, place, "", [&](const Value& child, const Place& where, const std::string&) {
    CollectMatrices(child, where, depth + 1, paths);
  });
}

}  // namespace

std::vector<NestedCamera> FindNestedCameras(const Entries& root, std::initializer_list<const char*> matrix_keys) {
  std::vector<NestedCamera> cameras;
  for (const auto& [key, entry] : root) {
    if (CollectCameras(entry.value, entry.place, entry.place.where, matrix_keys, 1, &cameras)) entry.value.used = true;
  }
  if (!cameras.empty()) RefuseEqualNames(root.begin()->second.place.path, cameras);
  return cameras;
}

std::vector<NestedCamera> NumberedCameras(const Entries& root, std::initializer_list<const char*> matrix_keys) {
  const std::initializer_list<const char*> kPoses = {"r", "t", "rvec", "tvec", "rotation", "translation"};
  const auto one_of = [](const std::string& word, std::initializer_list<const char*> words) {
    return std::find(words.begin(), words.end(), word) != words.end();
  };
  std::map<int, NestedCamera> cameras;
  for (const auto& [key, entry] : root) {
    const NumberedKey split = SplitNumber(key);
    const bool matrix = entry.value.kind == Value::Kind::kList || IsStoredMatrix(entry.value);
    if (matrix && !split.number.empty() && split.number.size() < 5 && one_of(split.stem, matrix_keys))
      cameras[std::stoi(split.number)].name = "cam" + split.number;
  }
  size_t poses = 0;
  const Entry* twice = nullptr;
  std::vector<const Entry*> taken;
  for (const auto& [key, entry] : root) {
    const NumberedKey split = SplitNumber(key);
    const bool number = entry.value.kind == Value::Kind::kNumber && split.stem.size() == 1;  // k1 of a lens, not K of camera 1
    if (split.number.empty() || split.number.size() > 4 || number) continue;
    const auto camera = cameras.find(std::stoi(split.number));
    if (camera == cameras.end()) continue;
    camera->second.where = camera->second.name;
    if (!camera->second.entries.insert({split.stem, entry}).second) twice = &entry;
    taken.push_back(&entry);
    poses += one_of(split.stem, kPoses);
  }
  if (cameras.size() < 2 || (cameras.size() == 2 && poses < 4)) return {};
  if (twice) throw FormatError(twice->place.path, twice->place.where, "this key of its camera occurs twice, by two names");
  std::vector<NestedCamera> found;
  for (auto& [number, camera] : cameras) found.push_back(std::move(camera));
  for (const Entry* entry : taken) entry->value.used = true;
  return found;
}

std::vector<std::string> MatrixPaths(const Entries& root) {
  std::vector<std::string> paths;
  for (const auto& [key, entry] : root) CollectMatrices(entry.value, entry.place, 1, &paths);
  return paths;
}

}  // namespace mvstudio::calib::internal
