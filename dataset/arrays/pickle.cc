#include "dataset/arrays/pickle.h"

#include <cmath>
#include <optional>

#include "core/error.h"
#include "dataset/arrays/pickle_machine.h"

namespace mvstudio::dataset {
namespace internal {
namespace {

using Kind = PickleValue::Kind;

int64_t WholeNumber(const PickleValue* value, const std::string& path, const std::string& where) {
  const bool whole =
      value && value->kind == Kind::kNumber && value->number == std::floor(value->number) && std::abs(value->number) < 1e12;
  if (!whole) throw FormatError(path, where, "must be a whole number");
  return static_cast<int64_t>(value->number);
}

}  // namespace

/// Array of numpy's state (version, shape, type, is Fortran's order, bytes), by way of the .npy file that would hold it.
NpyArray ArrayOf(const PickleValue& array, const std::string& path, const std::string& where) {
  const PickleValue* const state = array.state;
  if (!state || state->kind != Kind::kTuple || state->items.size() != 5 || state->items[1]->kind != Kind::kTuple ||
      state->items[2]->kind != Kind::kDtype || state->items[4]->kind != Kind::kText)
    throw FormatError(path, where, "is an array without its numbers");
  const PickleValue& dtype = *state->items[2];
  const bool little = !dtype.state || dtype.state->items.size() < 2 || !dtype.state->items[1]->IsText(">");
  if (!little) throw FormatError(path, where, "is not little-endian");
  std::string shape;
  for (const PickleValue* size : state->items[1]->items) {
    const int64_t count = WholeNumber(size, path, where);
    if (count < 0) throw FormatError(path, where, "has a negative size");
    shape += std::to_string(count) + ", ";
  }
  const bool fortran = state->items[3]->number != 0;
  const std::string type(dtype.text.substr(0, 8)),
      header =
          "{'descr': '<" + type + "', 'fortran_order': " + (fortran ? "True" : "False") + ", 'shape': (" + shape + "), }\n";
  std::string bytes = std::string("\x93NUMPY\x01\x00", 8) + static_cast<char>(header.size() & 0xff) +
                      static_cast<char>(header.size() >> 8) + header;
  bytes.append(state->items[4]->text);
  return ParseNpy(bytes, path + ": " + where);
}

}  // namespace internal

namespace {

using internal::ArrayOf;
using internal::PickleValue;
using internal::WholeNumber;
using Kind = PickleValue::Kind;

const PickleValue& Member(const PickleValue& object, const char* name, const std::string& path, const std::string& where) {
  const PickleValue* const found = object.state ? object.state->Find(name) : nullptr;
  if (!found) throw FormatError(path, where + "." + name, "is missing");
  return *found;
}

NpyArray MemberArray(const PickleValue& object, const char* name, const std::string& path, const std::string& where) {
  const PickleValue& member = Member(object, name, path, where);
  if (member.kind != Kind::kArray) throw FormatError(path, where + "." + name, "must be an array");
  return ArrayOf(member, path, where + "." + name);
}

/// Compressed sparse columns made dense.
NpyArray DenseOf(const PickleValue& sparse, const std::string& path, const std::string& where) {
  constexpr int64_t kMostValues = 1 << 22;  // SMPL-X has half a million
  const PickleValue* shape = sparse.state ? sparse.state->Find("_shape") : nullptr;
  if (!shape) shape = &Member(sparse, "shape", path, where);
  if (shape->kind != Kind::kTuple || shape->items.size() != 2) throw FormatError(path, where, "must have two dimensions");
  const int64_t rows = WholeNumber(shape->items[0], path, where), columns = WholeNumber(shape->items[1], path, where);
  if (rows < 0 || columns < 0 || (columns > 0 && rows > kMostValues / columns)) throw FormatError(path, where, "is too large");
  const NpyArray data = MemberArray(sparse, "data", path, where), indices = MemberArray(sparse, "indices", path, where),
                 starts = MemberArray(sparse, "indptr", path, where);
  if (static_cast<int64_t>(starts.values.size()) != columns + 1 || indices.values.size() != data.values.size())
    throw FormatError(path, where, "has lists of different lengths");
  NpyArray dense{{rows, columns}, std::vector<double>(static_cast<size_t>(rows * columns), 0.0)};
  const double end = static_cast<double>(data.values.size());
  for (int64_t c = 0; c < columns; ++c) {
    const double first = starts.values[static_cast<size_t>(c)], last = starts.values[static_cast<size_t>(c) + 1];
    if (!(first >= 0 && first <= last && last <= end)) throw FormatError(path, where + ".indptr", "is out of range");
    for (auto k = static_cast<size_t>(first); k < static_cast<size_t>(last); ++k) {
      const double row = indices.values[k];
      if (!(row >= 0 && row < static_cast<double>(rows))) throw FormatError(path, where + ".indices", "is out of range");
      dense.values[static_cast<size_t>(static_cast<int64_t>(row) * columns + c)] += data.values[k];
    }
  }
  return dense;
}

/// False for arrays of texts and of other objects.
bool HasNumbers(const PickleValue& array) {
  const PickleValue* const state = array.state;
  if (!state || state->items.size() != 5 || state->items[2]->kind != Kind::kDtype || state->items[2]->text.empty()) return true;
  return std::string_view("fiub").find(state->items[2]->text[0]) != std::string_view::npos;
}

std::optional<NpyArray> Convert(const PickleValue& value, const std::string& path, const std::string& where) {
  if (value.kind == Kind::kArray && HasNumbers(value)) return ArrayOf(value, path, where);
  if (value.kind != Kind::kObject) return std::nullopt;
  if (value.text == "chumpy.ch Ch") return MemberArray(value, "x", path, where);
  return DenseOf(value, path, where);
}

}  // namespace

std::map<std::string, NpyArray> ArraysFromPickle(const std::string& bytes, const std::string& path) {
  internal::PickleMachine machine(bytes, path);
  const PickleValue& root = machine.Run();
  if (root.kind != Kind::kDict) throw FormatError(path, "", "is no pickled dict");
  std::map<std::string, NpyArray> arrays;
  size_t total = 0;
  for (size_t i = 0; i + 1 < root.items.size(); i += 2) {
    if (root.items[i]->kind != Kind::kText) continue;
    const std::string key(root.items[i]->text);
    if (key.size() > 200) throw FormatError(path, "", "has a key of more than 200 bytes");
    std::optional<NpyArray> array = Convert(*root.items[i + 1], path, key);
    if (!array) continue;
    constexpr size_t kMostDense = 1 << 23;  // beside what the file itself holds
    total += array->values.size();
    if (total > 2 * bytes.size() + kMostDense) throw FormatError(path, key, "the same numbers are there too often");
    arrays[key] = std::move(*array);
  }
  return arrays;
}

}  // namespace mvstudio::dataset
