#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>

#include "dataset/arrays/pickle_machine.h"

namespace mvstudio::dataset::internal {
namespace {

using namespace std::string_view_literals;

/// `code` is below 0x110000.
void AppendUtf8(unsigned code, std::string* text) {
  if (code < 0x80) {
    *text += static_cast<char>(code);
  } else if (code < 0x800) {
    *text += static_cast<char>(0xc0 | code >> 6);
    *text += static_cast<char>(0x80 | (code & 0x3f));
  } else {
    if (code >= 0x10000) *text += static_cast<char>(0xf0 | code >> 18);
    *text += static_cast<char>(code >= 0x10000 ? 0x80 | (code >> 12 & 0x3f) : 0xe0 | code >> 12);
    *text += static_cast<char>(0x80 | (code >> 6 & 0x3f));
    *text += static_cast<char>(0x80 | (code & 0x3f));
  }
}

/// Hexadecimal digits at `at`; false when they are not all there.
bool HexAt(std::string_view text, size_t at, size_t count, unsigned* value) {
  if (at > text.size() || text.size() - at < count) return false;
  const auto [end, error] = std::from_chars(text.data() + at, text.data() + at + count, *value, 16);
  return error == std::errc() && end == text.data() + at + count;
}

}  // namespace

/// Two's complement of any length.
void PickleMachine::PushInteger(std::string_view little_endian) {
  double value = 0;
  for (size_t i = little_endian.size(); i-- > 0;) value = value * 256 + static_cast<unsigned char>(little_endian[i]);
  if (!little_endian.empty() && (static_cast<unsigned char>(little_endian.back()) & 0x80))
    value -= std::ldexp(1, 8 * static_cast<int>(little_endian.size()));
  Push(MakeNumber(value));
}

void PickleMachine::PushDecimal(std::string_view text) {
  if (!text.empty() && text.back() == 'L') text.remove_suffix(1);
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) Fail("is no number");
  Push(MakeNumber(value));
}

bool PickleMachine::StepNumber(unsigned char op) {
  switch (op) {
    case 'N':
      Push(Make(Kind::kNone));
      return true;
    case 0x88:
      Push(MakeNumber(1));
      return true;
    case 0x89:
      Push(MakeNumber(0));
      return true;
    case 'J':
      PushInteger(Take(4));
      return true;
    case 'K':
      Push(MakeNumber(static_cast<double>(TakeUnsigned(1))));
      return true;
    case 'M':
      Push(MakeNumber(static_cast<double>(TakeUnsigned(2))));
      return true;
    case 0x8a:
      PushInteger(Take(TakeUnsigned(1)));
      return true;
    case 'I':
    case 'L':
    case 'F':
      PushDecimal(TakeLine());
      return true;
    case 'G': {
      std::string big(Take(8));
      std::reverse(big.begin(), big.end());
      double value = 0;
      std::memcpy(&value, big.data(), 8);
      Push(MakeNumber(value));
      return true;
    }
    default:
      return false;
  }
}

/// A text as Python's repr writes it.
std::string_view PickleMachine::Unquote(std::string_view text) {
  if (text.size() < 2 || text.front() != text.back() || (text.front() != '\'' && text.front() != '"'))
    Fail("a text without its quotes");
  text = text.substr(1, text.size() - 2);
  std::string plain;
  for (size_t i = 0; i < text.size(); ++i) {
    if (text[i] != '\\') {
      plain += text[i];
      continue;
    }
    const char c = ++i < text.size() ? text[i] : '\0';
    unsigned code = 0;
    if (c == 'x' && HexAt(text, i + 1, 2, &code)) {
      plain += static_cast<char>(code);
      i += 2;
    } else if (const size_t known = "nrt\\'\""sv.find(c); c != '\0' && known != std::string_view::npos) {
      plain += "\n\r\t\\'\""[known];
    } else {
      Fail("an escape in a text that is not known");
    }
  }
  return Own(std::move(plain));
}

/// Python's raw-unicode-escape to UTF-8.
std::string_view PickleMachine::Unescape(std::string_view text) {
  std::string plain;
  for (size_t i = 0; i < text.size(); ++i) {
    unsigned code = 0;
    const size_t digits = text.substr(i, 2) == "\\u" ? 4 : text.substr(i, 2) == "\\U" ? 8 : 0;
    if (digits > 0 && HexAt(text, i + 2, digits, &code) && code < 0x110000) {
      AppendUtf8(code, &plain);
      i += 1 + digits;
    } else {
      AppendUtf8(static_cast<unsigned char>(text[i]), &plain);
    }
  }
  return Own(std::move(plain));
}

bool PickleMachine::StepText(unsigned char op) {
  switch (op) {
    case 'S':
      Push(MakeText(Unquote(TakeLine())));
      return true;
    case 'V':
      Push(MakeText(Unescape(TakeLine())));
      return true;
    case 'U':
    case 'C':
    case 0x8c:
      Push(MakeText(Take(TakeUnsigned(1))));
      return true;
    case 'T':
    case 'B':
    case 'X':
      Push(MakeText(Take(TakeUnsigned(4))));
      return true;
    case 0x8d:
    case 0x8e:
    case 0x96:
      Push(MakeText(Take(TakeUnsigned(8))));
      return true;
    default:
      return false;
  }
}

bool PickleMachine::StepContainer(unsigned char op) {
  const auto append = [this](Kind kind, const std::vector<PickleValue*>& items) {
    PickleValue* container = Top(kind);
    if (kind == Kind::kDict && items.size() % 2 != 0) Fail("a key without its value");
    container->items.insert(container->items.end(), items.begin(), items.end());
  };
  const auto make = [this, &append](Kind kind, const std::vector<PickleValue*>& items) {
    Push(Make(kind));
    append(kind, items);
  };
  switch (op) {
    case '(':
      marks_.push_back(stack_.size());
      return true;
    case ')':
      make(Kind::kTuple, {});
      return true;
    case ']':
      make(Kind::kList, {});
      return true;
    case '}':
      make(Kind::kDict, {});
      return true;
    case 't':
      make(Kind::kTuple, PopToMark());
      return true;
    case 'l':
      make(Kind::kList, PopToMark());
      return true;
    case 'd':
      make(Kind::kDict, PopToMark());
      return true;
    case 'e':
      append(Kind::kList, PopToMark());
      return true;
    case 'u':
      append(Kind::kDict, PopToMark());
      return true;
    case 'a':
      append(Kind::kList, {Pop()});
      return true;
    case 's': {
      PickleValue* const value = Pop();
      append(Kind::kDict, {Pop(), value});
      return true;
    }
    case 0x85:
    case 0x86:
    case 0x87:
      PushTuple(static_cast<size_t>(op - 0x84));
      return true;
    default:
      return false;
  }
}

bool PickleMachine::StepMemo(unsigned char op) {
  const auto line_key = [this] {
    const std::string_view line = TakeLine();
    uint64_t key = 0;
    const auto [end, error] = std::from_chars(line.data(), line.data() + line.size(), key);
    if (error != std::errc() || end != line.data() + line.size()) Fail("is no number");
    return key;
  };
  const auto recall = [this](uint64_t key) {
    const auto found = memo_.find(key);
    if (found == memo_.end()) Fail("refers to a value that is not there");
    Push(found->second);
  };
  switch (op) {
    case 'p':
      Remember(line_key());
      return true;
    case 'q':
      Remember(TakeUnsigned(1));
      return true;
    case 'r':
      Remember(TakeUnsigned(4));
      return true;
    case 0x94:
      Remember(memo_.size());
      return true;
    case 'g':
      recall(line_key());
      return true;
    case 'h':
      recall(TakeUnsigned(1));
      return true;
    case 'j':
      recall(TakeUnsigned(4));
      return true;
    case '0':
      Pop();
      return true;
    case '1':
      PopToMark();
      return true;
    case '2':
      Push(Pop()), Push(stack_.back());
      return true;
    default:
      return false;
  }
}

}  // namespace mvstudio::dataset::internal
