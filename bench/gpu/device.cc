#include "bench/gpu/device.h"

#include <ATen/Context.h>
#include <torch/torch.h>
#include <torch/version.h>

#if __has_include(<cuda_runtime_api.h>) && __has_include(<c10/cuda/CUDACachingAllocator.h>)
#define MVSTUDIO_CUDA_HEADERS 1
#include <c10/cuda/CUDACachingAllocator.h>
#endif

namespace mvstudio::avatar {

void AllowTf32(bool on) { at::globalContext().setAllowTF32CuDNN(on), at::globalContext().setAllowTF32CuBLAS(on); }

void Synchronise(const at::Device& device) {
  if (device.is_cuda()) torch::cuda::synchronize();
}

#ifdef MVSTUDIO_CUDA_HEADERS
int64_t PeakMemory(const at::Device& device) {
  return device.is_cuda() ? c10::cuda::CUDACachingAllocator::getDeviceStats(0).allocated_bytes[0].peak : 0;  // 0: of all pools
}

void ResetPeakMemory(const at::Device& device) {
  if (!device.is_cuda()) return;
  c10::cuda::CUDACachingAllocator::emptyCache();
  c10::cuda::CUDACachingAllocator::resetPeakStats(0);
}
#else
int64_t PeakMemory(const at::Device&) { return 0; }
void ResetPeakMemory(const at::Device&) {}
#endif

const char* LibtorchVersion() { return TORCH_VERSION; }

}  // namespace mvstudio::avatar
