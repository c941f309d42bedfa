#include "calib/formats/unused.h"

#include <algorithm>

#include "core/error.h"

namespace mvstudio::calib::internal {

std::string TextOf(const Value& value) {
  switch (value.kind) {
    case Value::Kind::kNull:
      return "";
    case Value::Kind::kNumber:
      return NumberText(value.number);
    case Value::Kind::kText:
      return value.text;
    case Value::Kind::kTable:
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

ImportNote UnusedKeysNote(const std::string& keys) {
  return {"CAL-KEYS", "keys of the file that are not read: " + keys,
          "look whether one of them says how the numbers are meant; docs/calibration-formats.md lists what is read"};
}

}  // namespace mvstudio::calib
