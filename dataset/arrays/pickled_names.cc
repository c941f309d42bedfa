#include "dataset/arrays/pickled_names.h"

#include <algorithm>
#include <cstdint>
#include <map>

namespace mvstudio::dataset::internal {
namespace {

constexpr size_t kMaxValues = 2'000'000, kMaxTuple = 16;

struct Value {
  enum class Kind { kText, kList, kMark } kind = Kind::kText;
  std::string text = {};
  std::vector<size_t> items = {};  // positions in the arena: a value may be in several lists
};

/// `code` is below 0x110000.
void AppendUtf8(uint32_t code, std::string* text) {
  const auto tail = [&](int shift) { text->push_back(static_cast<char>(0x80 | ((code >> shift) & 0x3f))); };
  if (code < 0x80) {
    text->push_back(static_cast<char>(code));
  } else if (code < 0x800) {
    text->push_back(static_cast<char>(0xc0 | (code >> 6))), tail(0);
  } else if (code < 0x10000) {
    text->push_back(static_cast<char>(0xe0 | (code >> 12))), tail(6), tail(0);
  } else {
    text->push_back(static_cast<char>(0xf0 | (code >> 18))), tail(12), tail(6), tail(0);
  }
}

/// Latin-1 with \\uXXXX and \\UXXXXXXXX for the rest (Python's raw-unicode-escape) as UTF-8; false for other escapes of u.
bool Unescape(std::string* text) {
  std::string out;
  for (size_t i = 0; i < text->size(); ++i) {
    uint32_t code = static_cast<unsigned char>((*text)[i]);
    const size_t length = text->compare(i, 2, "\\u") == 0 ? 4 : text->compare(i, 2, "\\U") == 0 ? 8 : 0;
    if (length > 0) {
      const std::string digits = text->substr(i + 2, length);
      if (digits.size() < length || digits.find_first_not_of("0123456789abcdefABCDEF") != std::string::npos) return false;
      code = static_cast<uint32_t>(std::stoul(digits, nullptr, 16));
      if (code >= 0x110000) return false;
      i += 1 + length;
    }
    AppendUtf8(code, &out);
  }
  *text = std::move(out);
  return true;
}

/// The pickle machine; every function is false where the pickle holds something else.
class Machine {
 public:
  explicit Machine(std::string_view bytes) : rest_(bytes) {}

  bool Run() {
    while (!rest_.empty()) {
      const char code = rest_.front();
      rest_.remove_prefix(1);
      if (code == '.') return stack_.size() == 1;
      if (!Step(code) || arena_.size() > kMaxValues) return false;
    }
    return false;
  }
  const Value& Top() const { return arena_[stack_.back()]; }
  const Value& At(size_t place) const { return arena_[place]; }

 private:
  bool Step(char code) {
    switch (code) {
      case '(':
        return Push({Value::Kind::kMark});
      case ']':
      case ')':
        return Push({Value::Kind::kList});
      case 'l':
      case 't':
        return FromMark();
      case '\x85':
      case '\x86':
      case '\x87':
        return Tuple(static_cast<size_t>(static_cast<unsigned char>(code) - 0x84));
      case 'a':
        return Append();
      case 'e':
        return Extend();
      default:
        return MemoStep(code) || TextStep(code);
    }
  }

  bool MemoStep(char code) {
    uint64_t place = 0;
    switch (code) {
      case 'p':
        return Line(&place) && Put(place);
      case 'q':
        return Number(1, &place) && Put(place);
      case 'r':
        return Number(4, &place) && Put(place);
      case '\x94':
        return Put(memo_.size());
      case 'g':
        return Line(&place) && Get(place);
      case 'h':
        return Number(1, &place) && Get(place);
      case 'j':
        return Number(4, &place) && Get(place);
      case '\x80':  // protocol
        return Number(1, &place);
      case '\x95':  // length of a frame
        return Number(8, &place);
      default:
        return false;
    }
  }

  bool TextStep(char code) {
    uint64_t size = 0;
    std::string text;
    switch (code) {
      case 'V':
        return Line(&text) && Unescape(&text) && Push({Value::Kind::kText, text});
      case 'X':
        return Number(4, &size) && Bytes(size);
      case '\x8c':
      case 'U':
        return Number(1, &size) && Bytes(size);
      case 'I':
      case 'L':
        return Line(&text) && Push({Value::Kind::kText, text});
      case 'K':
        return Number(1, &size) && Push({Value::Kind::kText, std::to_string(size)});
      case 'M':
        return Number(2, &size) && Push({Value::Kind::kText, std::to_string(size)});
      case 'J':
        return Number(4, &size) && Push({Value::Kind::kText, std::to_string(static_cast<int32_t>(size))});
      case 'N':
        return Push({Value::Kind::kText});
      default:
        return false;
    }
  }

  bool Push(Value value) {
    stack_.push_back(arena_.size());
    arena_.push_back(std::move(value));
    return true;
  }
  /// Position after the last mark; 0 when there is none.
  size_t AfterMark() const {
    size_t place = stack_.size();
    while (place > 0 && arena_[stack_[place - 1]].kind != Value::Kind::kMark) --place;
    return place;
  }
  bool Group(size_t begin, size_t pop) {
    std::vector<size_t> items(stack_.begin() + static_cast<std::ptrdiff_t>(begin), stack_.end());
    stack_.resize(begin - pop);
    return Push({Value::Kind::kList, {}, std::move(items)});
  }
  bool FromMark() {
    const size_t begin = AfterMark();
    return begin > 0 && Group(begin, 1);
  }
  bool Tuple(size_t count) { return stack_.size() >= count && Group(stack_.size() - count, 0); }
  /// Moves what stands from `begin` into the list that stands `gap` before it.
  bool MoveToList(size_t begin, size_t gap) {
    if (begin < gap || arena_[stack_[begin - gap]].kind != Value::Kind::kList) return false;
    std::vector<size_t>& items = arena_[stack_[begin - gap]].items;
    items.insert(items.end(), stack_.begin() + static_cast<std::ptrdiff_t>(begin), stack_.end());
    stack_.resize(begin - gap + 1);
    return items.size() <= kMaxValues;
  }
  bool Append() { return stack_.size() >= 2 && MoveToList(stack_.size() - 1, 1); }
  bool Extend() { return MoveToList(AfterMark(), 2); }
  bool Put(uint64_t place) {
    if (stack_.empty()) return false;
    memo_[place] = stack_.back();
    return true;
  }
  bool Get(uint64_t place) {
    const auto found = memo_.find(place);
    if (found == memo_.end()) return false;
    stack_.push_back(found->second);
    return stack_.size() <= kMaxValues;
  }

  bool Line(std::string* text) {
    const size_t end = rest_.find('\n');
    if (end == std::string_view::npos) return false;
    *text = rest_.substr(0, end);
    rest_.remove_prefix(end + 1);
    return true;
  }
  bool Line(uint64_t* number) {
    std::string text;
    if (!Line(&text) || text.empty() || text.size() > 9) return false;
    if (text.find_first_not_of("0123456789") != std::string::npos) return false;
    *number = std::stoull(text);
    return true;
  }
  bool Number(size_t bytes, uint64_t* number) {
    if (rest_.size() < bytes) return false;
    *number = 0;
    for (size_t i = 0; i < bytes; ++i) *number |= static_cast<uint64_t>(static_cast<unsigned char>(rest_[i])) << (8 * i);
    rest_.remove_prefix(bytes);
    return true;
  }
  bool Bytes(uint64_t size) {
    if (rest_.size() < size) return false;
    const std::string text(rest_.substr(0, size));
    rest_.remove_prefix(size);
    return Push({Value::Kind::kText, text});
  }

  std::string_view rest_;
  std::vector<Value> arena_;
  std::vector<size_t> stack_;
  std::map<uint64_t, size_t> memo_;
};

}  // namespace

std::optional<std::vector<std::vector<std::string>>> ReadPickledNames(std::string_view pickle) {
  Machine machine(pickle);
  if (!machine.Run() || machine.Top().kind != Value::Kind::kList) return std::nullopt;
  std::vector<std::vector<std::string>> rows;
  for (const size_t place : machine.Top().items) {
    const Value& row = machine.At(place);
    if (row.kind != Value::Kind::kList || row.items.size() > kMaxTuple) return std::nullopt;
    std::vector<std::string>& texts = rows.emplace_back();
    for (const size_t item : row.items) {
      if (machine.At(item).kind != Value::Kind::kText) return std::nullopt;
      texts.push_back(machine.At(item).text);
    }
  }
  return rows;
}

}  // namespace mvstudio::dataset::internal
