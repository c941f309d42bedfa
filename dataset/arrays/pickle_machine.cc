#include "dataset/arrays/pickle_machine.h"

#include "core/error.h"

namespace mvstudio::dataset::internal {

const PickleValue* PickleValue::Find(std::string_view key) const {
  for (size_t i = items.size(); kind == Kind::kDict && i >= 2; i -= 2) {
    if (items[i - 2]->IsText(key)) return items[i - 1];
  }
  return nullptr;
}

void PickleMachine::Fail(const std::string& what) const { throw FormatError(path_, "byte " + std::to_string(op_at_), what); }

std::string_view PickleMachine::Take(uint64_t count) {
  if (count > bytes_.size() - at_) Fail("the pickle is cut short");
  const std::string_view taken = std::string_view(bytes_).substr(at_, static_cast<size_t>(count));
  at_ += static_cast<size_t>(count);
  return taken;
}

uint64_t PickleMachine::TakeUnsigned(int count) {
  const std::string_view taken = Take(static_cast<uint64_t>(count));
  uint64_t value = 0;
  for (size_t i = taken.size(); i-- > 0;) value = value << 8 | static_cast<unsigned char>(taken[i]);
  return value;
}

std::string_view PickleMachine::TakeLine() {
  const size_t end = bytes_.find('\n', at_);
  if (end == std::string::npos) Fail("the pickle is cut short");
  const std::string_view line = Take(end - at_);
  ++at_;
  return line;
}

PickleValue* PickleMachine::Make(Kind kind) {
  values_.emplace_back();
  values_.back().kind = kind;
  return &values_.back();
}

PickleValue* PickleMachine::MakeText(std::string_view text) {
  PickleValue* value = Make(Kind::kText);
  value->text = text;
  return value;
}

PickleValue* PickleMachine::MakeNumber(double number) {
  PickleValue* value = Make(Kind::kNumber);
  value->number = number;
  return value;
}

/// Decoded texts are never longer than their sources, so that together they are no longer than the file, unless one source is
/// decoded again and again.
std::string_view PickleMachine::Own(std::string text) {
  owned_bytes_ += text.size();
  if (owned_bytes_ > 2 * bytes_.size() + 4096) Fail("decodes the same text too often");
  return owned_.emplace_back(std::move(text));
}

PickleValue* PickleMachine::Pop() {
  if (stack_.empty() || (!marks_.empty() && stack_.size() <= marks_.back())) Fail("takes more from the stack than there is");
  PickleValue* value = stack_.back();
  stack_.pop_back();
  return value;
}

PickleValue* PickleMachine::Top(Kind kind) {
  if (stack_.empty() || stack_.back()->kind != kind) Fail("adds to something else than a list or a dict");
  return stack_.back();
}

std::vector<PickleValue*> PickleMachine::PopToMark() {
  if (marks_.empty() || stack_.size() < marks_.back()) Fail("goes back to a mark that is not there");
  std::vector<PickleValue*> items(stack_.begin() + static_cast<std::ptrdiff_t>(marks_.back()), stack_.end());
  stack_.resize(marks_.back());
  marks_.pop_back();
  return items;
}

void PickleMachine::PushTuple(size_t count) {
  std::vector<PickleValue*> items(count);
  for (size_t i = count; i-- > 0;) items[i] = Pop();
  PickleValue* tuple = Make(Kind::kTuple);
  tuple->items = std::move(items);
  Push(tuple);
}

void PickleMachine::Remember(uint64_t key) {
  if (stack_.empty()) Fail("takes more from the stack than there is");
  memo_[key] = stack_.back();
}

const PickleValue& PickleMachine::Run() {
  for (size_t steps = 0;; ++steps) {
    op_at_ = at_;
    if (steps > max_steps_) Fail("has more than " + std::to_string(max_steps_) + " steps");
    const auto op = static_cast<unsigned char>(Take(1)[0]);
    if (op == '.') return *Pop();
    Step(op);
  }
}

void PickleMachine::Step(unsigned char op) {
  if (StepNumber(op) || StepText(op) || StepContainer(op) || StepMemo(op)) return;
  StepObject(op);
}

}  // namespace mvstudio::dataset::internal
