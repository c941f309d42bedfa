#pragma once

#include <cstdint>
#include <deque>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "core/disk/npy.h"

/// The one machine that reads pickles: of arrays (pickle.cc), of ZJU-MoCap (dataset/exports/read) and of names of columns
/// (dataset/trackers).
namespace mvstudio::dataset::internal {

/// A value of a pickle. Values may refer to each other in circles.
struct PickleValue {
  enum class Kind { kNone, kNumber, kText, kTuple, kList, kDict, kGlobal, kDtype, kArray, kObject };
  Kind kind = Kind::kNone;
  double number = 0;
  std::string_view text;            // of kText; "module name" of kGlobal and the class of kObject; "f8" of kDtype
  std::vector<PickleValue*> items;  // of kTuple and kList; keys and values in turn of kDict
  PickleValue* state = nullptr;     // what BUILD gave kDtype, kArray, kObject

  bool IsText(std::string_view wanted) const { return kind == Kind::kText && text == wanted; }
  /// Value of a text key of a dict, the last one; nullptr when there is none.
  const PickleValue* Find(std::string_view key) const;
};

/// A kArray's numbers. Throws FormatError, naming `where`, for what is no array of them.
NpyArray ArrayOf(const PickleValue& array, const std::string& path, const std::string& where);

class PickleMachine {
 public:
  /// `bytes` and `path` must outlive the machine and its values. At most `max_steps`, and so values, references and marks.
  PickleMachine(const std::string& bytes, const std::string& path, size_t max_steps = 4'000'000)
      : bytes_(bytes), path_(path), max_steps_(max_steps) {}
  PickleMachine(const PickleMachine&) = delete;
  PickleMachine& operator=(const PickleMachine&) = delete;

  /// Runs to the end: the value that the pickle stands for, owned by the machine.
  const PickleValue& Run();
  /// Values that Run() left on the stack; a pickle of Python leaves none.
  size_t num_left() const { return stack_.size(); }

 private:
  using Kind = PickleValue::Kind;

  [[noreturn]] void Fail(const std::string& what) const;
  std::string_view Take(uint64_t count);
  uint64_t TakeUnsigned(int count);
  std::string_view TakeLine();

  PickleValue* Make(Kind kind);
  PickleValue* MakeText(std::string_view text);
  PickleValue* MakeNumber(double number);
  std::string_view Own(std::string text);
  void Push(PickleValue* value) { stack_.push_back(value); }
  PickleValue* Pop();
  PickleValue* Top(Kind kind);
  std::vector<PickleValue*> PopToMark();
  void PushTuple(size_t count);
  void Remember(uint64_t key);

  void Step(unsigned char op);
  bool StepNumber(unsigned char op);
  bool StepText(unsigned char op);
  bool StepContainer(unsigned char op);
  bool StepMemo(unsigned char op);
  void StepObject(unsigned char op);

  void PushInteger(std::string_view little_endian);
  void PushDecimal(std::string_view text);
  std::string_view Unquote(std::string_view text);
  std::string_view Unescape(std::string_view text);
  void PushGlobal(std::string_view module, std::string_view name);
  void Reduce();
  PickleValue* Call(const PickleValue& function, const std::vector<PickleValue*>& arguments);
  PickleValue* FromBuffer(const std::vector<PickleValue*>& arguments);
  PickleValue* Encode(const std::vector<PickleValue*>& arguments);

  const std::string& bytes_;
  const std::string& path_;
  const size_t max_steps_;
  size_t at_ = 0, op_at_ = 0, owned_bytes_ = 0;
  std::deque<PickleValue> values_;
  std::deque<std::string> owned_;
  std::vector<PickleValue*> stack_;
  std::vector<size_t> marks_;
  std::unordered_map<uint64_t, PickleValue*> memo_;
};

}  // namespace mvstudio::dataset::internal
