#include "dataset/exports/pickle.h"

#include <cstring>

#include "core/check.h"
#include "core/disk/npy_write.h"

namespace mvstudio::exports {
namespace {

template <class T>
void Append(T value, std::string* bytes) {
  char raw[sizeof(T)];
  std::memcpy(raw, &value, sizeof(T));
  bytes->append(raw, sizeof(T));
}

// Pickle opcodes (Python's pickletools), protocol 3.

std::string Unicode(const std::string& utf8) {
  std::string bytes = "X";
  Append<uint32_t>(static_cast<uint32_t>(utf8.size()), &bytes);
  return bytes + utf8;
}

std::string Int(int value) {
  std::string bytes = "J";
  Append<int32_t>(value, &bytes);
  return bytes;
}

std::string Global(const std::string& module, const std::string& name) { return "c" + module + "\n" + name + "\n"; }

const char kFalse = '\x89', kTrue = '\x88', kTuple1 = '\x85', kTuple3 = '\x87';

/// numpy.dtype(kind) with the state that numpy gives it.
std::string Dtype(const std::string& kind, const std::string& order, int flags) {
  std::string bytes = Global("numpy", "dtype") + Unicode(kind) + kFalse + kTrue + kTuple3 + "R";
  bytes += "(" + Int(3) + Unicode(order) + "NNN" + Int(-1) + Int(-1) + Int(flags) + "tb";
  return bytes;
}

/// _reconstruct(ndarray, (0,), b'b') followed by its state (1, shape, dtype, False, data).
std::string Ndarray(const std::vector<size_t>& shape, const std::string& dtype, const std::string& data) {
  std::string bytes = Global("numpy.core.multiarray", "_reconstruct") + Global("numpy", "ndarray") + Int(0) + kTuple1 +
                      std::string("C\x01", 2) + "b" + kTuple3 + "R";
  bytes += "(" + Int(1) + "(";
  for (const size_t n : shape) bytes += Int(static_cast<int>(n));
  bytes += "t" + dtype + kFalse + data + "tb";
  return bytes;
}

}  // namespace

PyValue PyValue::Text(const std::string& utf8) {
  PyValue value;
  value.opcodes_ = Unicode(utf8);
  return value;
}

PyValue PyValue::List(const std::vector<PyValue>& items) {
  PyValue value;
  value.opcodes_ = "](";
  for (const PyValue& item : items) value.opcodes_ += item.opcodes_;
  value.opcodes_ += "e";
  return value;
}

PyValue PyValue::Dict(const std::vector<std::pair<std::string, PyValue>>& items) {
  PyValue value;
  value.opcodes_ = "}(";
  for (const auto& [key, item] : items) value.opcodes_ += Unicode(key) + item.opcodes_;
  value.opcodes_ += "u";
  return value;
}

PyValue PyValue::Array(const std::vector<size_t>& shape, const std::vector<double>& values) {
  size_t count = 1;
  for (const size_t n : shape) count *= n;
  MVS_CHECK(count == values.size(), values.size() << " values for an array of " << count);
  std::string data = "B";
  Append<uint32_t>(static_cast<uint32_t>(values.size() * sizeof(double)), &data);
  data.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(double));
  PyValue value;
  value.opcodes_ = Ndarray(shape, Dtype("f8", "<", 0), data);
  return value;
}

std::string PyValue::ToNpy() const {
  constexpr int kObjectFlags = 63;  // what numpy's object dtype carries
  const std::string objects = "](" + opcodes_ + "e";
  return NpyHeader("|O", {}) + std::string("\x80\x03", 2) + Ndarray({}, Dtype("O8", "|", kObjectFlags), objects) + ".";
}

}  // namespace mvstudio::exports
