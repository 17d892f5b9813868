# make -f firmware/examples/zenoh_pico.mk ZENOH_PICO=DIR: the robot over zenoh-pico, in build/robot.
# DIR holds the sources of zenoh-pico 1.x, built (make) with its library in DIR/build/lib.

ZENOH_PICO ?= $(error ZENOH_PICO=DIR names the sources of zenoh-pico)
FIRMWARE := $(dir $(lastword $(MAKEFILE_LIST)))..

build/robot: $(wildcard $(FIRMWARE)/src/*.[ch] $(FIRMWARE)/include/*.h $(FIRMWARE)/examples/*.[ch])
	mkdir -p build
	$(CC) -std=gnu11 -O2 -ffp-contract=off -fno-math-errno -DZENOH_LINUX -I$(FIRMWARE)/include \
	  -I$(ZENOH_PICO)/include $(FIRMWARE)/src/*.c $(FIRMWARE)/examples/loop.c \
	  $(FIRMWARE)/examples/zenoh_pico.c -L$(ZENOH_PICO)/build/lib -lzenohpico -lpthread -lm -o $@
