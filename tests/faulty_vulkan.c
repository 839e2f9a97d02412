// The system's Vulkan loader with a fault in it, so that what a driver does when a card fails can be met without one:
// stands before the real libvulkan.so.1 on LD_LIBRARY_PATH.
//
//   VULKAN_LOADER   the real one's path
//   VULKAN_FAULT    lost:N    from the Nth wait on, the device is lost
//                   hang:N    from the Nth wait on, nothing that was submitted ends any more
//                   memory:N  N MiB can be allocated
#include <dlfcn.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

typedef void (*Function)(void);
typedef Function (*GetProcAddr)(void *, const char *);
enum { SUCCESS = 0, TIMEOUT = 2, OUT_OF_DEVICE_MEMORY = -2, DEVICE_LOST = -4 };

static GetProcAddr of_instance, of_device;
static int (*real_wait)(void *, const void *, uint64_t);
static int (*real_counter)(void *, void *, uint64_t *);
static int (*real_idle)(void *);
static int (*real_allocate)(void *, const void *, const void *, void *);
static uint64_t waits, allocated, last_counter;

static uint64_t limit_of(const char *fault) {
    const char *asked = getenv("VULKAN_FAULT");
    size_t length = strlen(fault);
    if (!asked || strncmp(asked, fault, length) || asked[length] != ':') return UINT64_MAX;
    return strtoull(asked + length + 1, 0, 10);
}

static int is_lost(void) { return waits >= limit_of("lost"); }
static int hangs(void) { return waits >= limit_of("hang"); }

static int wait_semaphores(void *device, const void *info, uint64_t nanoseconds) {
    waits++;
    if (is_lost()) return DEVICE_LOST;
    if (!hangs()) return real_wait(device, info, nanoseconds);
    do usleep(nanoseconds < 1000000000 ? nanoseconds / 1000 : 1000000);
    while (nanoseconds == UINT64_MAX);
    return TIMEOUT;
}

static int semaphore_counter(void *device, void *semaphore, uint64_t *value) {
    if (is_lost()) return DEVICE_LOST;
    if (hangs()) {
        *value = last_counter;
        return SUCCESS;
    }
    int result = real_counter(device, semaphore, value);
    last_counter = *value;
    return result;
}

static int wait_idle(void *queue_or_device) {
    if (is_lost()) return DEVICE_LOST;
    while (hangs()) pause();
    return real_idle(queue_or_device);
}

// VkMemoryAllocateInfo: its type, what comes next, and the size.
struct AllocateInfo {
    uint32_t type;
    const void *next;
    uint64_t size;
};

static int allocate_memory(void *device, const void *info, const void *allocator, void *memory) {
    allocated += ((const struct AllocateInfo *)info)->size;
    if (allocated >> 20 >= limit_of("memory")) return OUT_OF_DEVICE_MEMORY;
    return real_allocate(device, info, allocator, memory);
}

static Function instead_of(const char *name, Function found) {
#define REPLACE(called, real, with)               \
    if (found && !strcmp(name, called)) {         \
        *(Function *)&real = found;               \
        return (Function)with;                    \
    }
    REPLACE("vkWaitSemaphores", real_wait, wait_semaphores)
    REPLACE("vkWaitSemaphoresKHR", real_wait, wait_semaphores)
    REPLACE("vkGetSemaphoreCounterValue", real_counter, semaphore_counter)
    REPLACE("vkGetSemaphoreCounterValueKHR", real_counter, semaphore_counter)
    REPLACE("vkQueueWaitIdle", real_idle, wait_idle)
    REPLACE("vkAllocateMemory", real_allocate, allocate_memory)
    return found;
}

static Function device_proc_addr(void *device, const char *name) {
    return instead_of(name, of_device(device, name));
}

Function vkGetInstanceProcAddr(void *instance, const char *name) {
    if (!of_instance) {
        void *real = dlopen(getenv("VULKAN_LOADER"), RTLD_NOW | RTLD_LOCAL);
        if (!real) {
            fprintf(stderr, "VULKAN_LOADER: %s\n", dlerror());
            return 0;
        }
        of_instance = (GetProcAddr)dlsym(real, "vkGetInstanceProcAddr");
    }
    Function found = of_instance(instance, name);
    if (found && !strcmp(name, "vkGetDeviceProcAddr")) {
        of_device = (GetProcAddr)found;
        return (Function)device_proc_addr;
    }
    return instead_of(name, found);
}
