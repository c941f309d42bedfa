#include <algorithm>
#include <array>

#include "dataset/arrays/pickle_machine.h"

namespace mvstudio::dataset::internal {
namespace {

using namespace std::string_view_literals;

// Everything that a pickle may name.
constexpr std::array kReconstruct = {"numpy.core.multiarray _reconstruct"sv, "numpy._core.multiarray _reconstruct"sv};
constexpr std::array kFromBuffer = {"numpy.core.numeric _frombuffer"sv, "numpy._core.numeric _frombuffer"sv};
constexpr std::array kNewObject = {"copy_reg _reconstructor"sv, "copyreg _reconstructor"sv};
constexpr std::array kEncode = {"_codecs encode"sv};
constexpr std::array kDtypes = {"numpy dtype"sv};
constexpr std::array kScalars = {"numpy.core.multiarray scalar"sv, "numpy._core.multiarray scalar"sv};
constexpr std::array kBases = {"__builtin__ object"sv, "builtins object"sv, "numpy ndarray"sv};
constexpr std::array kClasses = {"scipy.sparse.csc csc_matrix"sv, "scipy.sparse._csc csc_matrix"sv, "chumpy.ch Ch"sv};

template <class Names>
bool Has(const Names& names, std::string_view name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

bool IsKnown(std::string_view name) {
  return Has(kReconstruct, name) || Has(kFromBuffer, name) || Has(kNewObject, name) || Has(kEncode, name) ||
         Has(kDtypes, name) || Has(kBases, name) || Has(kScalars, name) || Has(kClasses, name);
}

/// A name for a message: printable, not long.
std::string Shown(std::string_view name) {
  std::string shown(name.substr(0, 80));
  for (char& c : shown) c = c >= ' ' && c <= '~' ? c : '?';
  return "'" + shown + "'";
}

}  // namespace

void PickleMachine::PushGlobal(std::string_view module, std::string_view name) {
  const std::string full = std::string(module) + " " + std::string(name);
  if (!IsKnown(full)) Fail("names " + Shown(std::string(module) + "." + std::string(name)) + ", which is not read");
  PickleValue* value = Make(Kind::kGlobal);
  value->text = Own(full);
  Push(value);
}

void PickleMachine::StepObject(unsigned char op) {
  switch (op) {
    case 0x80:
      if (TakeUnsigned(1) > 5) Fail("a protocol that is not known");
      return;
    case 0x95:
      Take(8);
      return;  // a frame's length
    case 'c': {
      const std::string_view module = TakeLine();
      PushGlobal(module, TakeLine());
      return;
    }
    case 0x93: {
      const PickleValue* const name = Pop();
      const PickleValue* const module = Pop();
      if (name->kind != Kind::kText || module->kind != Kind::kText) Fail("a class without a name");
      PushGlobal(module->text, name->text);
      return;
    }
    case 'R':
    case 0x81:
      Reduce();
      return;
    case 'b': {
      PickleValue* const state = Pop();
      PickleValue* const object = Pop();
      if (object->kind != Kind::kArray && object->kind != Kind::kDtype && object->kind != Kind::kObject)
        Fail("sets the state of something that has none");
      object->state = state;
      Push(object);
      return;
    }
    default:
      Fail("step " + std::to_string(op) + " is not read");
  }
}

void PickleMachine::Reduce() {
  const PickleValue* const arguments = Pop();
  const PickleValue* const function = Pop();
  if (function->kind != Kind::kGlobal || arguments->kind != Kind::kTuple) Fail("calls something that is no function");
  Push(Call(*function, arguments->items));
}

PickleValue* PickleMachine::Call(const PickleValue& function, const std::vector<PickleValue*>& arguments) {
  if (Has(kReconstruct, function.text)) return Make(Kind::kArray);
  if (Has(kFromBuffer, function.text)) return FromBuffer(arguments);
  if (Has(kScalars, function.text)) return Make(Kind::kNone);
  if (Has(kEncode, function.text)) return Encode(arguments);
  if (Has(kDtypes, function.text)) {
    if (arguments.empty() || arguments[0]->kind != Kind::kText) Fail("a type of numbers without a name");
    PickleValue* const dtype = Make(Kind::kDtype);
    dtype->text = arguments[0]->text;
    return dtype;
  }
  const PickleValue* class_of = &function;  // a class that is called, or the first argument of what makes an object of one
  if (Has(kNewObject, function.text)) class_of = arguments.empty() ? nullptr : arguments[0];
  if (!class_of || class_of->kind != Kind::kGlobal || !Has(kClasses, class_of->text)) Fail("makes an object that is not read");
  PickleValue* const object = Make(Kind::kObject);
  object->text = class_of->text;
  return object;
}

/// (bytes, type, shape, "C" or "F"): the array that _reconstruct makes of a state.
PickleValue* PickleMachine::FromBuffer(const std::vector<PickleValue*>& arguments) {
  if (arguments.size() != 4 || arguments[3]->kind != Kind::kText) Fail("makes an array that is not read");
  PickleValue* const state = Make(Kind::kTuple);
  state->items = {MakeNumber(1), arguments[2], arguments[1], MakeNumber(arguments[3]->text == "F"), arguments[0]};
  PickleValue* const array = Make(Kind::kArray);
  array->state = state;
  return array;
}

/// Python 3 writes bytes for Python 2 as UTF-8 text to be encoded in Latin-1.
PickleValue* PickleMachine::Encode(const std::vector<PickleValue*>& arguments) {
  if (arguments.size() != 2 || arguments[0]->kind != Kind::kText ||
      !(arguments[1]->IsText("latin1") || arguments[1]->IsText("latin-1")))
    Fail("encodes something else than a text in Latin-1");
  const std::string_view text = arguments[0]->text;
  std::string plain;
  for (size_t i = 0; i < text.size(); ++i) {
    auto c = static_cast<unsigned char>(text[i]);
    if (c >= 0x80) {
      if ((c != 0xc2 && c != 0xc3) || i + 1 >= text.size()) Fail("a text that Latin-1 does not have");
      c = static_cast<unsigned char>((c & 3) << 6 | (static_cast<unsigned char>(text[++i]) & 0x3f));
    }
    plain += static_cast<char>(c);
  }
  return MakeText(Own(std::move(plain)));
}

}  // namespace mvstudio::dataset::internal
