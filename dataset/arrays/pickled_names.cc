#include "dataset/arrays/pickled_names.h"

#include <cmath>

#include "core/error.h"
#include "dataset/arrays/pickle_machine.h"

namespace mvstudio::dataset::internal {
namespace {

using Kind = PickleValue::Kind;

constexpr size_t kMaxSteps = 2'000'000, kMaxTuple = 16;

bool IsSequence(const PickleValue& value) { return value.kind == Kind::kList || value.kind == Kind::kTuple; }

std::optional<std::string> NameOf(const PickleValue& value) {
  if (value.kind == Kind::kText) return std::string(value.text);
  if (value.kind == Kind::kNone) return "";
  const bool whole = value.kind == Kind::kNumber && std::floor(value.number) == value.number && std::abs(value.number) < 1e15;
  return whole ? std::optional(std::to_string(static_cast<int64_t>(value.number))) : std::nullopt;
}

}  // namespace

std::optional<std::vector<std::vector<std::string>>> ReadPickledNames(const std::string& pickle) try {
  PickleMachine machine(pickle, "", kMaxSteps);
  const PickleValue& root = machine.Run();
  if (!IsSequence(root) || machine.num_left() > 0) return std::nullopt;
  std::vector<std::vector<std::string>> rows;
  for (const PickleValue* row : root.items) {
    if (!IsSequence(*row) || row->items.size() > kMaxTuple) return std::nullopt;
    std::vector<std::string>& texts = rows.emplace_back();
    for (const PickleValue* item : row->items) {
      std::optional<std::string> name = NameOf(*item);
      if (!name) return std::nullopt;
      texts.push_back(*std::move(name));
    }
  }
  return rows;
} catch (const FormatError&) {  // the caller names the place
  return std::nullopt;
}

}  // namespace mvstudio::dataset::internal
