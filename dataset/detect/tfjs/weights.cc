#include "dataset/detect/tfjs/weights.h"

#include <cmath>
#include <cstring>

namespace mvstudio::detect::internal {
namespace {

struct Encoding {
  std::string stored;  // "float32", "int32", "float16", "uint8" or "uint16"
  size_t bytes = 4;
  double scale = 1, min = 0;
};

Encoding ReadEncoding(const JsonView& weight, const std::string& dtype) {
  Encoding encoding;
  encoding.stored = dtype;
  if (dtype != "float32" && dtype != "int32") weight.Fail("has type " + dtype + "; float32 and int32 are known");
  if (!weight.Has("quantization")) return encoding;
  const JsonView quantization = weight["quantization"];
  encoding.stored = quantization["dtype"].Text();
  const bool half = encoding.stored == "float16";
  if (encoding.stored != "uint8" && encoding.stored != "uint16" && !half) {
    quantization.Fail("is " + encoding.stored + "; float16, uint8 and uint16 are known");
  }
  if (half && dtype != "float32") quantization.Fail("is float16 for a weight of type " + dtype);
  encoding.bytes = encoding.stored == "uint8" ? 1 : 2;
  if (half) return encoding;
  encoding.scale = quantization["scale"].Number();
  encoding.min = quantization["min"].Number();
  return encoding;
}

template <class T>
T Load(const char* data, size_t idx) {
  T value;
  std::memcpy(&value, data + idx * sizeof(T), sizeof(T));
  return value;
}

double Decode(const Encoding& encoding, const char* data, size_t idx) {
  if (encoding.stored == "float32") return Load<float>(data, idx);
  if (encoding.stored == "int32") return Load<int32_t>(data, idx);
  if (encoding.stored == "float16") return HalfToFloat(Load<uint16_t>(data, idx));
  const double level = encoding.stored == "uint8" ? Load<uint8_t>(data, idx) : Load<uint16_t>(data, idx);
  return level * encoding.scale + encoding.min;
}

TfWeight DecodeWeight(const JsonView& view, const Encoding& encoding, const char* data, size_t count, bool is_int) {
  TfWeight weight;
  weight.is_int = is_int;
  for (size_t i = 0; i < count; ++i) {
    const double value = Decode(encoding, data, i);
    if (!std::isfinite(value)) view.Fail("value " + std::to_string(i) + " is not finite");
    if (!is_int) {
      weight.floats.push_back(static_cast<float>(value));
    } else if (std::abs(std::round(value)) <= 2147483647.0) {
      weight.ints.push_back(static_cast<int32_t>(std::lround(value)));
    } else {
      view.Fail("value " + std::to_string(i) + " is too large for int32");
    }
  }
  return weight;
}

std::vector<int64_t> ReadDims(const JsonView& list) {
  std::vector<int64_t> dims;
  if (list.ArraySize() > 8) list.Fail("has more than 8 dimensions");
  for (size_t i = 0; i < list.ArraySize(); ++i) dims.push_back(list[i].LongInt());
  return dims;
}

std::string JoinShards(const JsonView& paths, const std::map<std::string, std::string>& shards) {
  std::string bytes;
  for (size_t i = 0; i < paths.ArraySize(); ++i) {
    const auto found = shards.find(paths[i].Text());
    if (found == shards.end()) paths[i].Fail("names a weight file that is not there");
    bytes += found->second;
  }
  return bytes;
}

void ReadGroup(const JsonView& group, const std::map<std::string, std::string>& shards,
               std::map<std::string, TfWeight>* weights) {
  const std::string bytes = JoinShards(group["paths"], shards);
  size_t offset = 0;
  for (size_t i = 0; i < group["weights"].ArraySize(); ++i) {
    const std::string name = group["weights"][i]["name"].Text();
    const JsonView view = group["weights"][i].Named("weight '" + name + "'");
    const std::string dtype = view["dtype"].Text();
    const Encoding encoding = ReadEncoding(view, dtype);
    const std::vector<int64_t> shape = ReadDims(view["shape"]);
    const size_t count = static_cast<size_t>(CountElements(view.path(), view.where(), shape));
    if (count * encoding.bytes > bytes.size() - offset) {
      view.Fail("needs bytes " + std::to_string(offset) + " to " + std::to_string(offset + count * encoding.bytes) +
                " of its file, which has " + std::to_string(bytes.size()) + "; cut short?");
    }
    TfWeight weight = DecodeWeight(view, encoding, bytes.data() + offset, count, dtype == "int32");
    weight.shape = shape;
    offset += count * encoding.bytes;
    if (!weights->emplace(name, std::move(weight)).second) view.Fail("is there twice");
  }
  if (offset != bytes.size()) {
    group.Fail("its weights need " + std::to_string(offset) + " bytes, its files have " + std::to_string(bytes.size()));
  }
}

}  // namespace

float HalfToFloat(uint16_t half) {
  const int exponent = half >> 10 & 0x1f;
  const int fraction = half & 0x3ff;
  const float sign = half & 0x8000 ? -1.0f : 1.0f;
  if (exponent == 31) return fraction ? NAN : sign * INFINITY;
  if (exponent == 0) return sign * std::ldexp(static_cast<float>(fraction), -24);
  return sign * std::ldexp(static_cast<float>(fraction + 1024), exponent - 25);
}

std::map<std::string, TfWeight> ReadWeights(const JsonView& manifest, const std::map<std::string, std::string>& shards) {
  std::map<std::string, TfWeight> weights;
  for (size_t i = 0; i < manifest.ArraySize(); ++i) ReadGroup(manifest[i], shards, &weights);
  return weights;
}

}  // namespace mvstudio::detect::internal
