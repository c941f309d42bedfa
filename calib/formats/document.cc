#include "calib/formats/document.h"

#include <algorithm>

#include "calib/formats/format_camera.h"
#include "core/error.h"
#include "geometry/rigid/rigid3.h"

namespace mvstudio::calib::internal {

bool AddEntry(const std::string& key, Value value, Value* table) {
  for (const auto& entry : table->entries) {
    if (entry.first == key) return false;
  }
  table->entries.emplace_back(key, std::move(value));
  return true;
}

void ValueView::Fail(const std::string& what) const { throw FormatError(*path_, where_, what); }

const Value* ValueView::Find(std::string_view key) const {
  for (const auto& [name, value] : value_->entries) {
    if (name != key) continue;
    value.used = true;
    return &value;
  }
  return nullptr;
}

ValueView ValueView::operator[](std::string_view key) const {
  if (value_->kind != Value::Kind::kTable) Fail("a table of keys and values was expected");
  const Value* found = Find(key);
  if (!found) Fail("the key '" + std::string(key) + "' is missing");
  return {*path_, *found, where_.empty() ? std::string(key) : where_ + "." + std::string(key)};
}

ValueView ValueView::operator[](size_t idx) const {
  if (idx >= ListSize()) Fail("entry " + std::to_string(idx) + " is missing");
  return {*path_, value_->items[idx], where_ + "[" + std::to_string(idx) + "]"};
}

size_t ValueView::ListSize() const {
  if (value_->kind != Value::Kind::kList) Fail("a list was expected");
  return value_->items.size();
}

double ValueView::Number() const {
  if (value_->kind != Value::Kind::kNumber) Fail("a number was expected");
  return value_->number;
}

const std::string& ValueView::Text() const {
  if (value_->kind != Value::Kind::kText) Fail("a text was expected");
  return value_->text;
}

Eigen::VectorXd ValueView::Vector() const {
  Eigen::VectorXd vector(static_cast<Eigen::Index>(ListSize()));
  for (size_t i = 0; i < ListSize(); ++i) vector[static_cast<Eigen::Index>(i)] = (*this)[i].Number();
  return vector;
}

Eigen::VectorXd ValueView::Vector(size_t size) const {
  if (ListSize() != size) Fail(std::to_string(ListSize()) + " numbers, " + std::to_string(size) + " expected");
  return Vector();
}

Eigen::MatrixXd ValueView::Matrix(size_t rows, size_t cols) const {
  if (ListSize() != rows) Fail(std::to_string(ListSize()) + " rows, " + std::to_string(rows) + " expected");
  Eigen::MatrixXd matrix(static_cast<Eigen::Index>(rows), static_cast<Eigen::Index>(cols));
  for (size_t i = 0; i < rows; ++i) matrix.row(static_cast<Eigen::Index>(i)) = (*this)[i].Vector(cols).transpose();
  return matrix;
}

geometry::Rigid3 ValueView::Transform() const {
  const Eigen::MatrixXd matrix = Matrix(ListSize() == 3 ? 3 : 4, 4);
  if (matrix.rows() == 4 && matrix.row(3) != Eigen::RowVector4d(0, 0, 0, 1)) Fail("the last row must be 0, 0, 0, 1");
  geometry::Rigid3 transform;
  transform.rotation = MakeRotation(matrix.topLeftCorner<3, 3>(), place());
  transform.translation = matrix.topRightCorner<3, 1>();
  return transform;
}

std::string TextOf(const Value& value) {
  switch (value.kind) {
    case Value::Kind::kNull:
      return "";
    case Value::Kind::kNumber:
      return NumberText(value.number);
    case Value::Kind::kText:
      return value.text;
    case Value::Kind::kTable:
      for (const auto& [key, entry] : value.entries) {
        if (key == "data") return TextOf(entry);  // OpenCV's matrices
      }
      return value.entries.empty() ? "" : "{…}";
    case Value::Kind::kList:
      break;
  }
  constexpr size_t kShown = 16;
  std::string text;
  for (size_t i = 0; i < std::min(value.items.size(), kShown); ++i) text += (i ? ", " : "[") + TextOf(value.items[i]);
  return text.empty() ? "" : text + "]";
}

void AddLensWords(const ValueView& table, geometry::LensWords* words) {
  for (const auto& [key, value] : table.value().entries) {
    if (!geometry::LensWords::IsKey(key)) continue;
    const ValueView view = table[key];
    words->Add(view.place().path, view.where(), key, TextOf(view.value()));
  }
}

geometry::LensKind LensKindOf(const geometry::LensWords& words, const ReadOptions& options, const Place& place) {
  const geometry::LensKind said = words.kind(), given = options.lens;
  if (given == geometry::LensKind::kUnsaid || said == geometry::LensKind::kUnsaid || said == given)
    return said == geometry::LensKind::kUnsaid ? given : said;
  throw FormatError(
      place.path, place.where,
      "option 'lens' " + std::string(ToString(given)) + " contradicts the file, which says " + std::string(ToString(said)));
}

void AddUnused(const ValueView& table, std::initializer_list<const char*> harmless, geometry::UnusedKeys* unused) {
  for (const auto& [key, value] : table.value().entries) {
    const std::string where = (table.where().empty() ? "" : table.where() + ".") + Printable(key),
                      plain = geometry::PlainKey(key);
    if (!value.used) {
      if (std::find(harmless.begin(), harmless.end(), plain) == harmless.end())
        unused->Add(where, Printable(key), TextOf(value));
    } else if (value.kind == Value::Kind::kTable) {
      AddUnused(table[key], harmless, unused);
    } else {
      for (size_t i = 0; i < value.items.size(); ++i) {
        if (value.items[i].kind == Value::Kind::kTable) AddUnused(table[key][i], harmless, unused);
      }
    }
  }
}

void AddUnusedNote(const geometry::UnusedKeys& unused, ImportedRig* imported) {
  const std::string keys = unused.Text();
  if (!keys.empty()) imported->notes.push_back(UnusedKeysNote(keys));
}

}  // namespace mvstudio::calib::internal

namespace mvstudio::calib {

Notice UnusedKeysNote(const std::string& keys) {
  return {"CAL-KEYS", "keys of the file that are not read: " + keys,
          "look whether one of them says how the numbers are meant; docs/calibration-formats.md lists what is read"};
}

}  // namespace mvstudio::calib
