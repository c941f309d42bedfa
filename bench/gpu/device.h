#pragma once

#include <c10/core/Device.h>

#include <cstdint>

namespace mvstudio::avatar {

/// Convolutions and products of float32: as they are, or rounded to TF32 as libtorch's convolutions are by default on a GPU.
void AllowTf32(bool on);

/// Waits for all work of a GPU; nothing on the CPU.
void Synchronise(const at::Device& device);

/// Peak of the memory that tensors took on a GPU since the last ResetPeakMemory, bytes; 0: not known.
int64_t PeakMemory(const at::Device& device);
void ResetPeakMemory(const at::Device& device);

/// "2.11.0", "1.13.0", of the headers.
const char* LibtorchVersion();

}  // namespace mvstudio::avatar
